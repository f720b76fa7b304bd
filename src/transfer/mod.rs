//! From what a user edits (colour maps, opacity points, range policies) to the [`NodeTable`](crate::node_table::NodeTable) that renderers see.
