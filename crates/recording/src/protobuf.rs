//! Encodes protocol buffers: the few kinds of fields that messages for viewers have. Fields with their default value are left
//! out.

/// A message, encoded field by field.
#[derive(Debug)]
pub(crate) struct Protobuf(Vec<u8>);

/// An empty message, with room for most of those that have no others within them.
impl Default for Protobuf {
    fn default() -> Self {
        Self(Vec::with_capacity(64))
    }
}

/// Kinds of encoded values.
const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const BYTES: u64 = 2;
const FIXED32: u64 = 5;

impl Protobuf {
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    /// An integer, an enumerated value, or true as 1.
    pub(crate) fn integer(mut self, field: u64, value: u64) -> Self {
        if value != 0 {
            self.varint(field << 3 | VARINT);
            self.varint(value);
        }
        self
    }

    pub(crate) fn double(mut self, field: u64, value: f64) -> Self {
        if value.to_bits() != 0 {
            self.varint(field << 3 | FIXED64);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    pub(crate) fn fixed32(mut self, field: u64, value: u32) -> Self {
        if value != 0 {
            self.varint(field << 3 | FIXED32);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    pub(crate) fn text(self, field: u64, text: &str) -> Self {
        self.bytes(field, text.as_bytes())
    }

    pub(crate) fn bytes(self, field: u64, bytes: &[u8]) -> Self {
        if bytes.is_empty() {
            return self;
        }
        self.delimited(field, bytes)
    }

    /// A message within this one; also one that is empty.
    pub(crate) fn message(self, field: u64, message: &Self) -> Self {
        self.delimited(field, &message.0)
    }

    fn delimited(mut self, field: u64, bytes: &[u8]) -> Self {
        self.varint(field << 3 | BYTES);
        self.varint(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
        self
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples of the format's documentation.
    #[test]
    fn fields_are_encoded_as_documented() {
        let integer = Protobuf::default().integer(1, 150);
        assert_eq!(integer.0, [0x08, 0x96, 0x01]);
        assert_eq!(
            Protobuf::default().message(3, &integer).0,
            [0x1a, 0x03, 0x08, 0x96, 0x01]
        );
        assert_eq!(Protobuf::default().text(2, "testing").0, b"\x12\x07testing");
        assert_eq!(
            Protobuf::default().double(1, 1.0).fixed32(2, 7).0,
            [9, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f, 0x15, 7, 0, 0, 0]
        );
        let defaults = Protobuf::default().integer(1, 0).double(2, 0.0).text(3, "");
        assert!(defaults.0.is_empty());
    }
}
