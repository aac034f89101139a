//! Drawing and pages. Computes nothing: a number in a report exists as data elsewhere.
use crate::{Calibration, Measurements, Result, Sensor, SigmaModel, SigmaTable};
#[derive(Debug, Clone, Copy)]
pub enum Overlay {
    PaperEq1,
}
impl std::str::FromStr for Overlay {
    type Err = String;
    fn from_str(_: &str) -> std::result::Result<Self, String> {
        Ok(Overlay::PaperEq1)
    }
}
pub struct Figure2;
impl Figure2 {
    pub fn of(_: &SigmaTable, _: &SigmaModel, _: &[Overlay]) -> Self {
        Figure2
    }
    pub fn svg(&self) -> Result<String> {
        Ok(String::new())
    }
    pub fn png(&self) -> Result<Vec<u8>> {
        Ok(vec![])
    }
}
pub struct SigmaMap;
impl SigmaMap {
    pub fn of(_: &SigmaTable, _: &SigmaModel) -> Self {
        SigmaMap
    }
    pub fn svg(&self) -> Result<String> {
        Ok(String::new())
    }
    pub fn png(&self) -> Result<Vec<u8>> {
        Ok(vec![])
    }
}
pub struct CalibrationPage<'a> {
    pub title: &'a str,
    pub sensor: Option<&'a Sensor>,
    pub measurements: Option<&'a Measurements>,
    pub calibration: &'a Calibration,
    pub overlays: &'a [Overlay],
}
pub fn calibration_page(_: &CalibrationPage<'_>) -> Result<String> {
    Ok(String::new())
}
