//! Room for values that C writes, between two guard zones. A library that writes a little past its room is found out
//! before its damage is taken for results; one that writes far past it can only be contained in a process of its own.

/// Cells of each zone.
const ZONE: usize = 64;

/// A value that no library writes by chance.
pub(super) trait Mark: Copy {
    const MARK: Self;
    fn is_mark(self) -> bool;
}

impl Mark for f64 {
    const MARK: Self = f64::from_bits(0x7ff4_ba5e_ba11_f00d);
    fn is_mark(self) -> bool {
        // By bits: a NaN equals nothing.
        self.to_bits() == Self::MARK.to_bits()
    }
}

impl Mark for i32 {
    const MARK: Self = 0x5aa5_c33c;
    fn is_mark(self) -> bool {
        self == Self::MARK
    }
}

impl Mark for u8 {
    const MARK: Self = 0xa5;
    fn is_mark(self) -> bool {
        self == Self::MARK
    }
}

/// A buffer that is used again and again and grows to the largest request.
pub(super) struct Guarded<T> {
    cells: Vec<T>,
    length: usize,
}

impl<T> Default for Guarded<T> {
    fn default() -> Self {
        Self { cells: Vec::new(), length: 0 }
    }
}

/// Cells outside the room that no longer hold the mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Trespass {
    pub before: usize,
    pub after: usize,
}

impl<T: Mark> Guarded<T> {
    /// Lays out room for as many values, holding these, and gives its place; valid until the next call.
    pub fn lay_out(&mut self, values: &[T]) -> *mut T {
        self.length = values.len();
        self.cells.clear();
        self.cells.resize(ZONE, T::MARK);
        self.cells.extend_from_slice(values);
        self.cells.resize(ZONE + values.len() + ZONE, T::MARK);
        // SAFETY: ZONE is within the buffer, which was just filled beyond it.
        unsafe { self.cells.as_mut_ptr().add(ZONE) }
    }

    /// What was written into the room, or how many cells around it were.
    pub fn written(&self) -> Result<&[T], Trespass> {
        let (before, rest) = self.cells.split_at_checked(ZONE).unwrap_or_default();
        let (room, after) = rest.split_at_checked(self.length).unwrap_or_default();
        let count = |zone: &[T]| zone.iter().filter(|cell| !cell.is_mark()).count();
        match (count(before), count(after)) {
            (0, 0) => Ok(room),
            (before, after) => Err(Trespass { before, after }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trespass<T: Mark>(other: T) {
        for (offset, expected) in [(-64, (1, 0)), (-1, (1, 0)), (3, (0, 1)), (66, (0, 1))] {
            let mut buffer = Guarded::default();
            let place = buffer.lay_out(&[other; 3]);
            // SAFETY: within the zones, which belong to the buffer.
            unsafe { place.offset(offset).write(other) };
            let Trespass { before, after } = buffer.written().err().unwrap();
            assert_eq!((before, after), expected, "{offset}");
        }
        let mut buffer = Guarded::default();
        for length in [3, 0, 2] {
            buffer.lay_out(&[other; 3][..length]);
            assert_eq!(buffer.written().unwrap().len(), length);
        }
    }

    #[test]
    fn a_single_cell_on_either_side_is_noticed() {
        trespass(f64::NAN);
        trespass(0_i32);
        trespass(0_u8);
    }
}
