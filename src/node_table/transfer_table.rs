//! [`TransferTable`]: the transfer function of a request, over one or more quantities.

use super::{JointTable, NodeTable};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The transfer function of a request. Cheap to clone; compared by address first, since tables are long and mostly identical.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TransferTable {
    /// Over the scalar.
    Scalar(Arc<NodeTable>),
    /// Also over coefficients of variation (table rows) or gradient magnitudes (table layers). Segments are then integrated exactly,
    /// whatever the optics.
    Joint(Arc<JointTable>),
}

impl TransferTable {
    /// The table over the scalar alone that bounds visibility, always the same [`Arc`]: the table itself, or the
    /// [projection](JointTable::projection) of a joint one.
    pub fn over_scalars(&self) -> &Arc<NodeTable> {
        match self {
            Self::Scalar(table) => table,
            Self::Joint(table) => table.projection(),
        }
    }

    /// The joint table; `None` if it is over the scalar alone.
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
