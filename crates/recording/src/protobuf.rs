//! Encodes protocol buffers: the few kinds of fields that messages for viewers have. Fields with their default value are left
//! out.

/// A message that is appended to bytes, field by field.
#[derive(Debug)]
pub(crate) struct Protobuf<'a>(&'a mut Vec<u8>);

/// Kinds of encoded values.
const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const BYTES: u64 = 2;
const FIXED32: u64 = 5;

impl<'a> Protobuf<'a> {
    /// An empty message after these bytes.
    pub(crate) fn append_to(bytes: &'a mut Vec<u8>) -> Self {
        Self(bytes)
    }

    /// An integer, an enumerated value, or true as 1.
    pub(crate) fn integer(&mut self, field: u64, value: u64) -> &mut Self {
        if value != 0 {
            self.varint(field << 3 | VARINT);
            self.varint(value);
        }
        self
    }

    pub(crate) fn double(&mut self, field: u64, value: f64) -> &mut Self {
        if value.to_bits() != 0 {
            self.varint(field << 3 | FIXED64);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    pub(crate) fn fixed32(&mut self, field: u64, value: u32) -> &mut Self {
        if value != 0 {
            self.varint(field << 3 | FIXED32);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    pub(crate) fn text(&mut self, field: u64, text: &str) -> &mut Self {
        if !text.is_empty() {
            self.varint(field << 3 | BYTES);
            self.varint(text.len() as u64);
            self.0.extend_from_slice(text.as_bytes());
        }
        self
    }

    /// Bytes that `content` appends; also none.
    pub(crate) fn bytes(&mut self, field: u64, content: impl FnOnce(&mut Vec<u8>)) -> &mut Self {
        self.varint(field << 3 | BYTES);
        let mut at = self.0.len();
        self.0.push(0);
        content(self.0);

        // The length goes before the content, in one byte for most.
        let mut len = self.0.len() - at - 1;
        while len >= 0x80 {
            self.0[at] = len as u8 | 0x80;
            len >>= 7;
            at += 1;
            self.0.insert(at, 0);
        }
        self.0[at] = len as u8;
        self
    }

    /// A message within this one; also one that is empty.
    pub(crate) fn message(
        &mut self,
        field: u64,
        content: impl FnOnce(&mut Protobuf<'_>),
    ) -> &mut Self {
        self.bytes(field, |bytes| content(&mut Protobuf(bytes)))
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

    /// The bytes of a message.
    fn encoded(message: impl FnOnce(&mut Protobuf<'_>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        message(&mut Protobuf::append_to(&mut bytes));
        bytes
    }

    fn integer(to: &mut Protobuf<'_>) {
        to.integer(1, 150);
    }

    /// Examples of the format's documentation.
    #[test]
    fn fields_are_encoded_as_documented() {
        assert_eq!(encoded(integer), [0x08, 0x96, 0x01]);
        let nested = encoded(|to| {
            to.message(3, integer);
        });
        assert_eq!(nested, [0x1a, 0x03, 0x08, 0x96, 0x01]);
        let text = encoded(|to| {
            to.text(2, "testing");
        });
        assert_eq!(text, b"\x12\x07testing");
        let fixed = encoded(|to| {
            to.double(1, 1.0).fixed32(2, 7);
        });
        assert_eq!(fixed, [9, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f, 0x15, 7, 0, 0, 0]);
        let defaults = encoded(|to| {
            to.integer(1, 0).double(2, 0.0).text(3, "");
        });
        assert!(defaults.is_empty());
    }

    #[test]
    fn a_long_field_has_its_length_in_several_bytes() {
        for (len, head) in [
            (127, &[0x0a, 0x7f][..]),
            (128, &[0x0a, 0x80, 0x01]),
            (300, &[0x0a, 0xac, 0x02]),
            (16_384, &[0x0a, 0x80, 0x80, 0x01]),
        ] {
            let content = vec![7; len];
            let long = encoded(|to| {
                to.bytes(1, |bytes| bytes.extend_from_slice(&content));
            });
            assert_eq!(long, [head, &content].concat(), "{len} bytes");
        }
    }
}
