//! The `tetreel` command.

fn main() {}
