//! [`TransferTable`]: the transfer function of a request, over whatever quantities.

use super::{JointTable, NodeTable};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A transfer function as a request has it. Cheap to clone; two are compared by address first, since tables are long and mostly the
/// same one.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TransferTable {
    /// Over the scalar.
    #[serde(with = "content")]
    Scalar(Arc<NodeTable>),
    /// Also over coefficients of variation (rows) or magnitudes of gradients (layers). Segments are integrated exactly then, whatever
    /// the optics.
    #[serde(with = "content")]
    Joint(Arc<JointTable>),
}

impl TransferTable {
    /// The table over the scalar alone that says where nothing is to be seen, always the same [`Arc`]: the table itself, or the
    /// [projection](JointTable::projection) of one over more.
    pub fn over_scalars(&self) -> &Arc<NodeTable> {
        match self {
            Self::Scalar(table) => table,
            Self::Joint(table) => table.projection(),
        }
    }

    /// The table if it is over more than the scalar.
    pub fn joint(&self) -> Option<&Arc<JointTable>> {
        match self {
            Self::Scalar(_) => None,
            Self::Joint(table) => Some(table),
        }
    }
}

impl From<Arc<NodeTable>> for TransferTable {
    fn from(table: Arc<NodeTable>) -> Self {
        Self::Scalar(table)
    }
}

impl From<Arc<JointTable>> for TransferTable {
    fn from(table: Arc<JointTable>) -> Self {
        Self::Joint(table)
    }
}

impl PartialEq for TransferTable {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Scalar(a), Self::Scalar(b)) => Arc::ptr_eq(a, b) || a == b,
            (Self::Joint(a), Self::Joint(b)) => Arc::ptr_eq(a, b) || a == b,
            (Self::Scalar(_), Self::Joint(_)) | (Self::Joint(_), Self::Scalar(_)) => false,
        }
    }
}

/// What the table is, not where.
mod content {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub(super) fn serialize<T: Serialize, S: Serializer>(table: &Arc<T>, serializer: S) -> Result<S::Ok, S::Error> {
        T::serialize(table, serializer)
    }

    pub(super) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(data: D) -> Result<Arc<T>, D::Error> {
        T::deserialize(data).map(Arc::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(tau: f32) -> Arc<JointTable> {
        let values = [0.0, tau].map(|tau| [0.5, 0.5, 0.5, tau]);
        Arc::new(JointTable::new(vec![1.0], vec![0.0, 1.0], vec![0.0], values.to_vec()).unwrap())
    }

    #[test]
    fn equal_tables_are_equal_wherever_they_are_and_one_over_more_is_not_its_projection() {
        let (a, b, other) = (joint(2.0), joint(2.0), joint(3.0));
        let table = |of: &Arc<JointTable>| TransferTable::from(of.clone());
        assert!(table(&a) == table(&a) && table(&a) == table(&b) && table(&a) != table(&other));
        let projection = |of: &Arc<JointTable>| TransferTable::from(table(of).over_scalars().clone());
        assert!(projection(&a) == projection(&b) && projection(&a) != projection(&other));
        assert!(projection(&a) != table(&a));
        assert!(Arc::ptr_eq(table(&a).over_scalars(), table(&a).over_scalars()));
    }
}
