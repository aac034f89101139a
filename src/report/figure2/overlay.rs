//! Published surfaces to draw beside the fit.

use std::str::FromStr;

use crate::model::SigmaModel;

/// A published surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overlay {
    /// The paper's Eq. 1.
    PaperEq1,
    /// Nguyen, Izadi and Lovell 2012.
    Nguyen,
    /// Khoshelham and Elberink 2012.
    Khoshelham,
}

impl Overlay {
    /// In the order of their years, the paper first.
    pub const ALL: [Overlay; 3] = [Overlay::PaperEq1, Overlay::Nguyen, Overlay::Khoshelham];

    /// As the command line says it.
    pub fn id(self) -> &'static str {
        match self {
            Overlay::PaperEq1 => "eq1",
            Overlay::Nguyen => "nguyen",
            Overlay::Khoshelham => "khoshelham",
        }
    }

    /// As a legend says it.
    pub fn label(self) -> &'static str {
        match self {
            Overlay::PaperEq1 => "paper, Eq. 1",
            Overlay::Nguyen => "Nguyen et al. 2012",
            Overlay::Khoshelham => "Khoshelham 2012",
        }
    }

    /// The surface, over the range its authors measured.
    pub fn model(self) -> SigmaModel {
        match self {
            Overlay::PaperEq1 => SigmaModel::paper(),
            Overlay::Nguyen => SigmaModel::nguyen(),
            Overlay::Khoshelham => SigmaModel::khoshelham(),
        }
    }
}

impl FromStr for Overlay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Overlay::ALL.into_iter().find(|o| o.id() == text).ok_or_else(|| {
            let known = Overlay::ALL.map(Overlay::id).join(", ");
            format!("there is no overlay \"{text}\"; the overlays are {known}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlays_are_named_as_on_the_command_line() {
        for overlay in Overlay::ALL {
            assert_eq!(overlay.id().parse(), Ok(overlay));
        }
        assert!("eq2".parse::<Overlay>().unwrap_err().contains("eq1, nguyen, khoshelham"));
    }
}
