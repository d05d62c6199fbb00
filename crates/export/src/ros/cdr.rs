//! Messages of ROS 2 in CDR, little-endian, as the middlewares of ROS put them on the wire: four bytes that say so, then the fields in
//! their order, each aligned to its own size.

/// What says that little-endian CDR follows.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A message that is appended to bytes.
pub(super) struct Cdr<'a> {
    bytes: &'a mut Vec<u8>,
    /// Where its fields begin: alignment counts from here.
    begin: usize,
}

impl<'a> Cdr<'a> {
    pub(super) fn begin(bytes: &'a mut Vec<u8>) -> Self {
        bytes.extend_from_slice(&HEADER);
        Self {
            begin: bytes.len(),
            bytes,
        }
    }

    fn align(&mut self, size: usize) {
        let len = (self.bytes.len() - self.begin).next_multiple_of(size);
        self.bytes.resize(self.begin + len, 0);
    }

    pub(super) fn i32(&mut self, value: i32) {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.align(8);
            self.bytes.extend_from_slice(&value.to_le_bytes());
        }
    }

    /// A text, with its length and a zero at its end, which counts.
    pub(super) fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }
}
