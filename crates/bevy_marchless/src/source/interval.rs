//! [`Interval`]: interval arithmetic for bounds.

/// All numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Interval {
    pub(crate) const NOTHING: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    pub(crate) fn exactly(value: f64) -> Self {
        Self { low: value, high: value }
    }

    /// The smallest interval that holds all values.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        values.into_iter().fold(Self::NOTHING, |so_far, value| Self {
            low: if value < so_far.low { value } else { so_far.low },
            high: if value > so_far.high { value } else { so_far.high },
        })
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }

    pub(crate) fn times(self, other: Self) -> Self {
        let ends = [self.low, self.high];
        Self::of(ends.into_iter().flat_map(|a| [a * other.low, a * other.high]))
    }

    pub(crate) fn scaled(self, by: f64) -> Self {
        Self::of([self.low * by, self.high * by])
    }

    pub(crate) fn negated(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }

    pub(crate) fn abs(self) -> Self {
        if self.low >= 0.0 {
            self
        } else if self.high <= 0.0 {
            self.negated()
        } else {
            Self { low: 0.0, high: self.high.max(-self.low) }
        }
    }

    /// The interval of the smaller of two numbers.
    pub(crate) fn min(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.min(other.high) }
    }

    /// The interval of the larger of two numbers.
    pub(crate) fn max(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.max(other.high) }
    }

    /// The interval with both ends clamped to another.
    pub(crate) fn within(self, other: Self) -> Self {
        self.max(Self::exactly(other.low)).min(Self::exactly(other.high))
    }

    /// The image of the interval under a monotonically rising function.
    pub(crate) fn through(self, rising: impl Fn(f64) -> f64) -> Self {
        Self { low: rising(self.low), high: rising(self.high) }
    }

    /// The interval widened on both sides, for rounding: by a share of the larger absolute end.
    pub(crate) fn widened(self, share: f64) -> Self {
        let more = share * self.low.abs().max(self.high.abs());
        Self { low: self.low - more, high: self.high + more }
    }

    pub(crate) fn middle(self) -> f64 {
        self.low / 2.0 + self.high / 2.0
    }

    pub(crate) fn half(self) -> f64 {
        self.high / 2.0 - self.low / 2.0
    }
}
