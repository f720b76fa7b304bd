//! Generated series with known properties.
