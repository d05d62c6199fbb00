//! How a diagram is drawn.

/// How a diagram is drawn.
#[derive(Debug, Clone)]
pub struct Options {
    /// Text above the picture; none if it is empty.
    pub title: String,
    /// Whether lost queries are drawn.
    pub queries: bool,
    /// Whether time in which nothing happens is always drawn to scale. Otherwise a wide window has gaps instead.
    pub is_whole: bool,
    /// Most pixels of width.
    pub max_width_px: f64,
    /// Whether the text contains its style sheet. Without it, the page that shows the picture has to have [`crate::diagram::style`].
    pub has_style: bool,
    /// Whether the picture has a legend of signs and colors. A legend on the page can be that of several pictures.
    pub has_legend: bool,
    /// Width of a tick, pixels, so that several pictures have the same scale; without it the window decides.
    pub tick_px: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            title: String::new(),
            queries: false,
            is_whole: false,
            max_width_px: 4800.0,
            has_style: true,
            has_legend: true,
            tick_px: None,
        }
    }
}
