//! From a source to a store in one streamed pass.
