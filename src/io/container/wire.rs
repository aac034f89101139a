//! Reads the fields of a serialised message in order.

/// Serialisation format of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// Little-endian, packed.
    Ros1,
    /// OMG's Common Data Representation as ROS 2 writes it: aligned, either byte order.
    Cdr,
}

/// What is wrong with a message.
pub type Damage = String;

pub struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    pub dialect: Dialect,
    big_endian: bool,
}

impl<'a> Wire<'a> {
    /// Fails if the message has a CDR variant that ROS does not write.
    pub fn new(bytes: &'a [u8], dialect: Dialect) -> Result<Self, Damage> {
        let packed = Wire { bytes, at: 0, dialect, big_endian: false };
        match (dialect, bytes) {
            (Dialect::Ros1, _) => Ok(packed),
            // Alignment is relative to the end of this header.
            (Dialect::Cdr, [0, order @ (0 | 1), _, _, body @ ..]) => {
                Ok(Wire { bytes: body, big_endian: *order == 0, ..packed })
            }
            (Dialect::Cdr, _) => Err("it does not begin as plain CDR does (00 00 or 00 01)".into()),
        }
    }

    pub fn take(&mut self, n: usize) -> Result<&'a [u8], Damage> {
        let rest = &self.bytes[self.at..];
        let taken = rest.get(..n).ok_or_else(|| {
            format!("a field of {n} bytes begins where only {} are left", rest.len())
        })?;
        self.at += n;
        Ok(taken)
    }

    /// Skips the padding before a number of `n` bytes in CDR.
    fn align(&mut self, n: usize) {
        if self.dialect == Dialect::Cdr {
            self.at = self.at.next_multiple_of(n).min(self.bytes.len());
        }
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], Damage> {
        self.align(N);
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub fn u8(&mut self) -> Result<u8, Damage> {
        self.number().map(u8::from_le_bytes)
    }

    pub fn u16(&mut self) -> Result<u16, Damage> {
        self.number().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, Damage> {
        self.number().map(u32::from_le_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, Damage> {
        self.number().map(f32::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, Damage> {
        self.number().map(f64::from_le_bytes)
    }

    /// A length-prefixed string; in CDR it ends with a zero byte.
    pub fn text(&mut self) -> Result<String, Damage> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        let bytes = bytes.strip_suffix(b"\0").unwrap_or(bytes);
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    pub fn f64s(&mut self) -> Result<Vec<f64>, Damage> {
        let length = self.u32()? as usize;
        if length.saturating_mul(8) > self.left() {
            return Err(format!(
                "{length} numbers are announced where {} bytes are left",
                self.left()
            ));
        }
        (0..length).map(|_| self.f64()).collect()
    }

    pub fn left(&self) -> usize {
        self.bytes.len() - self.at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_is_aligned_behind_its_header_and_says_its_byte_order() {
        let little = [0, 1, 0, 0, 7, 0, 0, 0, 1, 2, 0, 0];
        let mut wire = Wire::new(&little, Dialect::Cdr).unwrap();
        assert_eq!((wire.u8(), wire.u32()), (Ok(7), Ok(0x0201)));
        let big = [0, 0, 0, 0, 0, 0, 0, 3, b'a', b'b', 0];
        assert_eq!(Wire::new(&big, Dialect::Cdr).unwrap().text(), Ok("ab".into()));
        assert!(Wire::new(&[0, 7, 0, 0], Dialect::Cdr).is_err());
    }

    #[test]
    fn no_length_is_believed() {
        let bytes = [0xff, 0xff, 0xff, 0xff, 1];
        let wire = || Wire::new(&bytes, Dialect::Ros1).unwrap();
        assert!(wire().text().unwrap_err().contains("only 1 are left"));
        assert!(wire().f64s().unwrap_err().contains("4294967295 numbers"));
    }
}
