//! Arrays as an importer hands them over, and the ways to get them wrong that a callee can see.

use super::World;
use crate::verdict::Verdict;

/// What is wrong with one array of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nothing.
    None,
    /// Array number so many is NULL.
    Null(usize),
    /// It begins in the middle of a number.
    Crooked(usize),
    /// The count is one that no array can have.
    Endless(usize),
}

/// Counts whose bytes do not fit into an address space, whatever the type.
const ENDLESS: [usize; 3] = [usize::MAX, isize::MAX as usize, isize::MAX as usize / 4 + 1];

impl Fault {
    /// The pointer to array number `k`.
    pub fn read<T>(self, k: usize, array: &[T]) -> *const T {
        match self {
            Fault::Null(which) if which == k => std::ptr::null(),
            Fault::Crooked(which) if which == k => array.as_ptr().cast::<u8>().wrapping_add(1).cast(),
            _ => array.as_ptr(),
        }
    }

    /// The same to be written to.
    pub fn write<T>(self, k: usize, array: &mut [T]) -> *mut T {
        match self {
            Fault::Null(which) if which == k => std::ptr::null_mut(),
            Fault::Crooked(which) if which == k => array.as_mut_ptr().cast::<u8>().wrapping_add(1).cast(),
            _ => array.as_mut_ptr(),
        }
    }

    /// The count given with arrays of `n`.
    pub fn count(self, n: usize) -> usize {
        if let Fault::Endless(count) = self { count } else { n }
    }

    /// What must come of it, in arrays of `n` with these names in C.
    pub fn verdict(self, n: usize, names: &[&str]) -> Option<Verdict> {
        let (argument, found) = match self {
            Fault::Null(k) if n > 0 => (names[k], "NULL"),
            Fault::Crooked(k) if n > 0 => (names[k], "misaligned"),
            // The first array is looked at first.
            Fault::Endless(_) => (names[0], "longer than the address space"),
            _ => return None,
        };
        Some(Verdict::refuse([&format!("argument {argument} is {found}"), "expected"]))
    }
}

impl World<'_> {
    /// Mostly nothing wrong; `arrays` is how many arrays the call has.
    pub(super) fn fault(&mut self, arrays: usize) -> Fault {
        if !self.choices.once_in(24) {
            return Fault::None;
        }
        let which = self.choices.below(arrays);
        match self.choices.below(4) {
            0 | 1 => Fault::Null(which),
            2 => Fault::Crooked(which),
            _ => Fault::Endless(self.choices.of(&ENDLESS)),
        }
    }
}
