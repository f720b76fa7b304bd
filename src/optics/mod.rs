//! Integration of the emission-absorption model over one segment of a ray.
