//! What the face renderer does beside its image.
