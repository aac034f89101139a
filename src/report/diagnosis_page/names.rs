//! The catalogue in words for a person who has never heard of disparity.

/// What people call an effect, and what they would have seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name {
    /// In the middle of a sentence.
    pub short: &'static str,
    /// A sentence without capital and full stop.
    pub plain: &'static str,
}

/// The name of an effect of the catalogue; an id nobody has put into words names itself.
pub(super) fn name(id: &'static str) -> Name {
    let known = NAMES.iter().find(|(i, _, _)| *i == id);
    known.map_or(Name { short: id, plain: id }, |&(_, short, plain)| Name { short, plain })
}

/// Id, short name, plain words; the order of the catalogue.
const NAMES: [(&str, &str, &str); 29] = [
    (
        "disparity-quantisation",
        "depth in growing steps",
        "the sensor can only answer with certain depths, and the gaps between them widen with the distance",
    ),
    (
        "depth-rounding",
        "depth in equal steps",
        "the driver rounds depth to whole steps of the same size at every distance",
    ),
    (
        "pixel-locking",
        "ripples of depth",
        "smooth slopes come out with ripples, because the sensor leans towards whole pixels when it matches its pattern",
    ),
    (
        "column-banding",
        "vertical stripes",
        "the picture has faint upright stripes of wrong depth, always at the same columns",
    ),
    (
        "radial-disparity-bias",
        "a bowl in the depth",
        "a flat wall comes out as a shallow bowl, the deeper the farther away it is, because lens or projector are slightly off their calibration",
    ),
    (
        "lens-distortion",
        "uncorrected lens distortion",
        "the lens bends rays, so that a pixel looks a little beside where it should; slanted surfaces come out curved",
    ),
    (
        "range-not-depth",
        "ray length instead of depth",
        "the file holds the distance along each ray where the distance straight ahead is expected, which makes a flat wall a bowl",
    ),
    (
        "depth-scale",
        "a wrong scale of depth",
        "every depth is too long or too short by the same share",
    ),
    (
        "disparity-offset",
        "a constant shift of the match",
        "all depths are off to one side, by more and more the farther away",
    ),
    (
        "thermal-drift",
        "warm-up drift",
        "the sensor warms up, and its depths creep away in the course of the session",
    ),
    (
        "target-bow",
        "a bent board",
        "the board that was filmed is not flat: this is the board's doing and not the sensor's",
    ),
    (
        "target-motion",
        "movement during a view",
        "board or sensor moved while a view was being filmed",
    ),
    (
        "fixed-pattern-noise",
        "a fixed error of each pixel",
        "each pixel has a small error of its own that is the same in every picture",
    ),
    (
        "edge-mixing",
        "blurred edges of depth",
        "near the board's edge its depth is mixed with that of what is behind",
    ),
    (
        "range-exponent",
        "noise that grows with distance in another way",
        "the noise grows faster or slower with the distance than the simulation has it",
    ),
    (
        "slope-noise",
        "extra noise on slopes",
        "slanted surfaces are noisier, because a pixel does not know exactly where it looks",
    ),
    (
        "tilt-axis-anisotropy",
        "noise that depends on the way of the slant",
        "a board turned sideways is noisier than one tipped forwards by the same angle",
    ),
    (
        "vignetting",
        "noisier corners",
        "the corners of the picture get less light and are noisier than the middle",
    ),
    (
        "intensity-dependent-noise",
        "noisier dark surfaces",
        "dark surfaces send back less of the sensor's light and are noisier",
    ),
    (
        "ambient-light",
        "noise from the light of the room",
        "the light of the room outshines the sensor's own and makes it noisier",
    ),
    (
        "heavy-tails",
        "gross errors now and then",
        "now and then a pixel is wrong by much more than ordinary noise allows",
    ),
    (
        "spatial-correlation",
        "neighbours that err together",
        "neighbouring pixels make the same error, so that noise comes in blobs and not in single pixels",
    ),
    (
        "temporal-correlation",
        "pictures that remember the last one",
        "part of each picture is carried over from the one before",
    ),
    (
        "frozen-noise",
        "noise that stands still",
        "part of the noise is the same in every picture of a still scene, so that averaging does not remove it",
    ),
    (
        "row-noise",
        "rows that jump",
        "whole rows of the picture are shifted together, afresh in each picture",
    ),
    (
        "frame-jitter",
        "pictures that jump",
        "whole pictures are shifted together, each by another amount",
    ),
    (
        "grazing-dropout",
        "no depth at steep slants",
        "surfaces seen at a grazing angle get no depth at all",
    ),
    (
        "range-dropout",
        "no depth too near or too far",
        "surfaces too near or too far get no depth at all",
    ),
    (
        "occlusion-shadow",
        "a shadow beside the board",
        "a strip beside the board gets no depth, because the board hides it from the projector",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::CATALOGUE;

    #[test]
    fn every_effect_has_a_name() {
        for (effect, (id, short, plain)) in CATALOGUE.iter().zip(NAMES) {
            assert_eq!(effect.card().id, id);
            for words in [short, plain] {
                assert!(!words.ends_with('.') && words.chars().next().unwrap().is_lowercase());
            }
        }
        assert_eq!(CATALOGUE.len(), NAMES.len());
        assert_eq!(name("not-yet").short, "not-yet");
    }
}
