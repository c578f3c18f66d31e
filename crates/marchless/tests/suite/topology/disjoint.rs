//! Disjoint sets of the numbers below a length.

pub(crate) struct Disjoint(Vec<u32>);

impl Disjoint {
    /// Each number in a set of its own.
    pub(crate) fn new(len: usize) -> Self {
        Self((0..len as u32).collect())
    }

    /// The number that stands for the set of `item`.
    pub(crate) fn root(&mut self, mut item: usize) -> usize {
        while self.0[item] as usize != item {
            self.0[item] = self.0[self.0[item] as usize];
            item = self.0[item] as usize;
        }
        item
    }

    /// Unites the sets of two numbers.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}
