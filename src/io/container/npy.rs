//! The header of a .npy file (numpy.lib.format), and the numbers after it.
//!
//! It is a Python dictionary with three known keys; the crates that read it bring a parser
//! for Python literals with them.

use super::pixels::{Pixels, each};

/// Shape and number type of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    pub number: Number,
    pub shape: Vec<usize>,
    /// Length of the header in bytes.
    pub length: u64,
}

/// Type and byte order of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// NumPy's letter: u, i or f.
    kind: u8,
    /// Size in bytes.
    pub size: usize,
    big_endian: bool,
}

/// Longer than any header of a numeric array.
pub const MAX_HEADER: u64 = 16 << 10;
const MAGIC: &[u8] = b"\x93NUMPY";

/// What is wrong with a header.
#[derive(Debug)]
pub enum Fault {
    /// The array is whole, but its numbers are of a kind that no depth image has; how many dimensions.
    Numbers(String, usize),
    /// The same of an array in Fortran's order.
    Order(String, usize),
    Other(String),
}

impl<S: Into<String>> From<S> for Fault {
    fn from(what: S) -> Self {
        Fault::Other(what.into())
    }
}

impl Header {
    /// Parses the first bytes of a file or archive member, at most [`MAX_HEADER`].
    pub fn read(first: &[u8]) -> Result<Self, Fault> {
        let cut = || "the header is cut".to_string();
        let rest = first.strip_prefix(MAGIC).ok_or("it does not begin as a .npy file does")?;
        let ([version, _], rest) = rest.split_first_chunk().ok_or_else(cut)?;
        let (length, text) = match version {
            1 => {
                let (n, text) = rest.split_first_chunk().ok_or_else(cut)?;
                (usize::from(u16::from_le_bytes(*n)), text)
            }
            2 | 3 => {
                let (n, text) = rest.split_first_chunk().ok_or_else(cut)?;
                (u32::from_le_bytes(*n) as usize, text)
            }
            n => return Err(format!("version {n} of the format is not known").into()),
        };
        let header = text.get(..length).ok_or_else(cut)?;
        let header = String::from_utf8_lossy(header);
        let value = |key: &str| {
            let (_, after) = header.split_once(&format!("'{key}':"))?;
            Some(after.trim_start())
        };
        let missing = |key: &str| format!("the header has no {key}");
        let order = value("fortran_order").ok_or_else(|| missing("fortran_order"))?;
        let descr = value("descr").ok_or_else(|| missing("descr"))?;
        let descr = descr.strip_prefix('\'').and_then(|d| d.split_once('\'')).map(|(d, _)| d);
        let shape = value("shape").ok_or_else(|| missing("shape"))?;
        let shape = shape.strip_prefix('(').and_then(|s| s.split_once(')')).map(|(s, _)| s);
        let sizes = shape.unwrap_or("?").split(',').map(str::trim).filter(|s| !s.is_empty());
        let sizes: Option<Vec<usize>> = sizes.map(|s| s.parse().ok()).collect();
        let shape = sizes.ok_or("the shape is not understood")?;
        let number = descr.and_then(Number::of).ok_or_else(|| {
            let kind = descr.unwrap_or("records");
            let what = format!("its numbers are {kind}, not integers, nor floats of 32 or 64 bits");
            Fault::Numbers(what, shape.len())
        })?;
        if !order.starts_with("False") {
            let what = "it is in Fortran's order; save np.ascontiguousarray(a)".into();
            return Err(Fault::Order(what, shape.len()));
        }
        Ok(Header { number, shape, length: (first.len() - text.len() + length) as u64 })
    }

    /// Bytes of all numbers; `None` on overflow.
    pub fn bytes(&self) -> Option<u64> {
        let times = |n: u64, &size: &usize| n.checked_mul(size as u64);
        self.shape.iter().try_fold(self.number.size as u64, times)
    }
}

impl Number {
    /// Parses "<u2" and the like.
    fn of(descr: &str) -> Option<Self> {
        let [order, kind, size] = *descr.as_bytes() else { return None };
        let known =
            matches!(&[kind, size], [b'u' | b'i', b'1' | b'2' | b'4' | b'8'] | b"f4" | b"f8");
        let number =
            Number { kind, size: usize::from(size.wrapping_sub(b'0')), big_endian: order == b'>' };
        (known && b"<|=>".contains(&order)).then_some(number)
    }

    pub fn is_float(self) -> bool {
        self.kind == b'f'
    }

    pub fn values(self, bytes: &[u8]) -> Vec<f64> {
        macro_rules! values {
            ($kind:ty, $as:expr) => {{
                let of =
                    if self.big_endian { <$kind>::from_be_bytes } else { <$kind>::from_le_bytes };
                each([bytes].into_iter(), of).into_iter().map($as).collect()
            }};
        }
        match (self.kind, self.size) {
            (b'u', 1) => values!(u8, f64::from),
            (b'u', 2) => values!(u16, f64::from),
            (b'i', 2) => values!(i16, f64::from),
            (b'i', 4) => values!(i32, f64::from),
            (b'u', 4) => values!(u32, f64::from),
            (b'u', 8) => values!(u64, |v| v as f64),
            (b'i', 1) => values!(i8, f64::from),
            (b'i', 8) => values!(i64, |v| v as f64),
            (b'f', 4) => values!(f32, f64::from),
            _ => values!(f64, f64::from),
        }
    }

    /// Pixels of one image: words unchanged, floats divided by `per_metre` to give metres.
    /// The error is what is wrong, if integers are not 16-bit words.
    pub fn pixels(self, bytes: &[u8], per_metre: f64) -> Result<Pixels, String> {
        if (self.kind, self.size, self.big_endian) == (b'u', 2, false) {
            return Ok(Pixels::Words(each([bytes].into_iter(), u16::from_le_bytes)));
        }
        let values = self.values(bytes);
        if self.is_float() {
            return Ok(Pixels::Metres(
                values.into_iter().map(|v| (v / per_metre) as f32).collect(),
            ));
        }
        let word = |v: f64| match (0.0..=65_535.0).contains(&v) {
            true => Ok(v as u16),
            false => Err(format!("the value {v} is not of 16 bits")),
        };
        values.into_iter().map(word).collect::<Result<_, _>>().map(Pixels::Words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(dictionary: &str) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((dictionary.len() as u16).to_le_bytes());
        bytes.extend(dictionary.as_bytes());
        bytes
    }

    #[test]
    fn a_header_as_numpy_writes_it() {
        let bytes = file("{'descr': '>u2', 'fortran_order': False, 'shape': (3, 48, 64), }   \n");
        let header = Header::read(&bytes).unwrap();
        assert_eq!(header.shape, [3, 48, 64]);
        assert_eq!(header.length, bytes.len() as u64);
        assert_eq!(header.bytes(), Some(2 * 3 * 48 * 64));
        assert_eq!(header.number.pixels(&[1, 2], 1.0), Ok(Pixels::Words(vec![0x0102])));
        for cut in 0..bytes.len() {
            assert!(Header::read(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }

    #[test]
    fn what_is_no_array_of_numbers_is_refused() {
        let of = |text: &str| match Header::read(&file(text)).unwrap_err() {
            Fault::Numbers(what, 1) | Fault::Order(what, 1) => what,
            fault => panic!("{fault:?}"),
        };
        let fortran = of("{'descr': '<u2', 'fortran_order': True, 'shape': (2,), }");
        assert!(fortran.contains("ascontiguousarray"), "{fortran}");
        let objects = of("{'descr': '|O', 'fortran_order': False, 'shape': (2,), }");
        assert!(objects.contains("|O"), "{objects}");
        let records = of("{'descr': [('a', '<u2')], 'fortran_order': False, 'shape': (2,), }");
        assert!(records.contains("records"), "{records}");
        let huge =
            file("{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }");
        assert_eq!(Header::read(&huge).unwrap().bytes(), None);
    }
}
