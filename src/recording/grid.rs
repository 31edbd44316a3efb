//! A rectangular array of pixels.

/// Row-major pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` values.
    pub data: Vec<T>,
}

impl<T: Copy> Grid<T> {
    /// A grid of one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// The value at column `x`, row `y`; `None` outside.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Option<T> {
        if x < self.width && y < self.height { self.data.get(y * self.width + x).copied() } else { None }
    }

    /// The value at the pixel nearest to (u, v); `None` outside.
    #[must_use]
    pub fn nearest(&self, u: f64, v: f64) -> Option<T> {
        let (x, y) = (u.round(), v.round());
        if x < 0.0 || y < 0.0 || !x.is_finite() || !y.is_finite() {
            return None;
        }
        self.get(x as usize, y as usize)
    }
}
