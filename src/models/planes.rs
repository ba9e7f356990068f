//! Values and tangents of one model side by side, one of them shown: the functions of the list of variables
//! work on either.

use crate::fmi::Plane;

/// A model `M` with its tangents `T`, which are made when they are first looked at.
#[derive(Clone)]
pub struct Planes<M, T> {
    /// The model.
    pub values: M,
    tangents: Option<Box<T>>,
    shown: Plane,
}

impl<M, T> Planes<M, T> {
    /// A model, its values shown.
    pub fn new(values: M) -> Self {
        Self { values, tangents: None, shown: Plane::Values }
    }

    /// Shows the values.
    pub fn show_values(&mut self) {
        self.shown = Plane::Values;
    }

    /// Shows the tangents, made by `make` the first time and set to 0 by `clear`.
    pub fn show_tangents(&mut self, make: impl FnOnce(&M) -> T, clear: impl FnOnce(&mut T)) {
        clear(self.tangents.get_or_insert_with(|| Box::new(make(&self.values))));
        self.shown = Plane::Tangents;
    }

    /// The model and the tangents that were last looked at.
    pub fn both(&mut self) -> (&mut M, Option<&mut T>) {
        (&mut self.values, self.tangents.as_deref_mut())
    }

    /// What `of_values` reads, or `of_tangents` while those are shown.
    #[inline]
    pub fn get<'a, R>(
        &'a self,
        of_values: impl FnOnce(&'a M) -> R,
        of_tangents: impl FnOnce(&'a T) -> R,
    ) -> R {
        match &self.tangents {
            Some(tangents) if self.shown == Plane::Tangents => of_tangents(tangents),
            _ => of_values(&self.values),
        }
    }

    /// The same to be set.
    #[inline]
    pub fn get_mut<'a, R>(
        &'a mut self,
        of_values: impl FnOnce(&'a mut M) -> R,
        of_tangents: impl FnOnce(&'a mut T) -> R,
    ) -> R {
        match &mut self.tangents {
            Some(tangents) if self.shown == Plane::Tangents => of_tangents(tangents),
            _ => of_values(&mut self.values),
        }
    }
}
