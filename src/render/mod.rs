//! From scalars and a view to a frame.
