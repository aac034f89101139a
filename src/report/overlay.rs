//! Published surfaces drawn beside a fit.

use std::str::FromStr;

use crate::model::SigmaModel;

/// A published surface, drawn over the range that its authors measured.
#[derive(Debug, Clone, Copy)]
pub struct Overlay {
    /// Name on the command line.
    pub id: &'static str,
    /// Name in a legend.
    pub label: &'static str,
    /// The surface with its measured range.
    pub model: fn() -> SigmaModel,
    pub(super) dashes: [i32; 2],
}

impl Overlay {
    /// The paper's Eq. 1; Nguyen, Izadi and Lovell; Khoshelham and Elberink.
    pub const ALL: [Overlay; 3] = [
        Overlay { id: "eq1", label: "paper, Eq. 1", model: SigmaModel::paper, dashes: [9, 5] },
        Overlay {
            id: "nguyen",
            label: "Nguyen et al. 2012",
            model: SigmaModel::nguyen,
            dashes: [2, 4],
        },
        Overlay {
            id: "khoshelham",
            label: "Khoshelham 2012",
            model: SigmaModel::khoshelham,
            dashes: [15, 3],
        },
    ];
}

impl FromStr for Overlay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Overlay::ALL.into_iter().find(|o| o.id == text).ok_or_else(|| {
            let known = Overlay::ALL.map(|o| o.id).join(", ");
            format!("there is no overlay \"{text}\"; the overlays are {known}")
        })
    }
}
