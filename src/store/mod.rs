//! The dataset on disk: a Zarr v3 group.
