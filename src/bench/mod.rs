//! Run time beside error.
