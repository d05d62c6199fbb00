//! How large a printed figure is.

/// The paper of a printed figure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PrintSize {
    pub(crate) width_px: f64,
    pub(crate) height_px: f64,
    pub(crate) width_mm: f64,
}

impl PrintSize {
    pub(crate) fn mm_per_px(&self) -> f64 {
        self.width_mm / self.width_px
    }
}
