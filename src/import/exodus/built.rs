//! Small files in the classic formats of netCDF, built for tests.

/// A variable of a file.
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) dimensions: Vec<usize>,
    /// The number of its type, as the format has it.
    code: u32,
    pub(super) element_type: &'static str,
    /// Another attribute of text: name and value.
    pub(super) attribute: Option<(&'static str, &'static str)>,
    /// All its bytes; those of a step one behind the other if the first dimension is that of steps.
    pub(super) bytes: Vec<u8>,
}

/// A file in a classic format of netCDF.
pub(super) struct Classic {
    version: u8,
    pub(super) steps: usize,
    pub(super) dimensions: Vec<(String, usize)>,
    pub(super) variables: Vec<Variable>,
}

const CHAR: u32 = 2;
const INT: u32 = 4;
pub(super) const DOUBLE: u32 = 6;

impl Classic {
    pub(super) fn new(version: u8, steps: usize) -> Self {
        Self { version, steps, dimensions: vec![("time_step".to_owned(), 0)], variables: Vec::new() }
    }

    pub(super) fn dimension(&mut self, name: &str, size: usize) -> usize {
        self.dimensions.push((name.to_owned(), size));
        self.dimensions.len() - 1
    }

    pub(super) fn put(&mut self, name: &str, dimensions: &[usize], code: u32, bytes: Vec<u8>) -> &mut Variable {
        let (name, dimensions) = (name.to_owned(), dimensions.to_vec());
        self.variables.push(Variable { name, dimensions, code, element_type: "", attribute: None, bytes });
        self.variables.last_mut().unwrap()
    }

    pub(super) fn doubles(&mut self, name: &str, dimensions: &[usize], numbers: impl IntoIterator<Item = f64>) {
        self.put(name, dimensions, DOUBLE, numbers.into_iter().flat_map(f64::to_be_bytes).collect());
    }

    pub(super) fn ints(
        &mut self,
        name: &str,
        dimensions: &[usize],
        numbers: impl IntoIterator<Item = i32>,
    ) -> &mut Variable {
        self.put(name, dimensions, INT, numbers.into_iter().flat_map(i32::to_be_bytes).collect())
    }

    pub(super) fn names(&mut self, name: &str, dimension: &str, names: &[&str]) {
        let (rows, letters) = (self.dimension(dimension, names.len()), self.dimension(&format!("{dimension}_len"), 8));
        let row = |name: &&str| name.bytes().chain(std::iter::repeat(0)).take(8).collect::<Vec<u8>>();
        self.put(name, &[rows, letters], CHAR, names.iter().flat_map(row).collect());
    }

    fn count(&self, out: &mut Vec<u8>, number: usize) {
        let number = (number as u64).to_be_bytes();
        out.extend(if self.version == 5 { &number[..] } else { &number[4..] });
    }

    fn text(&self, out: &mut Vec<u8>, text: &str) {
        self.count(out, text.len());
        out.extend(text.bytes());
        out.resize(out.len().next_multiple_of(4), 0);
    }

    fn tag(&self, out: &mut Vec<u8>, tag: u32, count: usize) {
        out.extend(if count == 0 { 0 } else { tag }.to_be_bytes());
        self.count(out, count);
    }

    fn header(&self, offsets: &[u64]) -> Vec<u8> {
        let mut out = [b'C', b'D', b'F', self.version].to_vec();
        self.count(&mut out, self.steps);
        self.tag(&mut out, 10, self.dimensions.len());
        for (name, size) in &self.dimensions {
            self.text(&mut out, name);
            self.count(&mut out, *size);
        }
        self.tag(&mut out, 12, 0);
        self.tag(&mut out, 11, self.variables.len());
        for (variable, offset) in self.variables.iter().zip(offsets) {
            self.text(&mut out, &variable.name);
            self.count(&mut out, variable.dimensions.len());
            variable.dimensions.iter().for_each(|&dimension| self.count(&mut out, dimension));
            let element_type = Some(("elem_type", variable.element_type)).filter(|(_, value)| !value.is_empty());
            let attributes: Vec<_> = element_type.into_iter().chain(variable.attribute).collect();
            self.tag(&mut out, 12, attributes.len());
            for (name, value) in attributes {
                self.text(&mut out, name);
                out.extend(CHAR.to_be_bytes());
                self.text(&mut out, value);
            }
            out.extend(variable.code.to_be_bytes());
            self.count(&mut out, 0);
            let offset = offset.to_be_bytes();
            out.extend(if self.version == 1 { &offset[4..] } else { &offset });
        }
        out
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        let is_record = |variable: &Variable| variable.dimensions.first() == Some(&0);
        let mut at = self.header(&vec![0; self.variables.len()]).len() as u64;
        let mut offsets = vec![0; self.variables.len()];
        for pass in [false, true] {
            for (variable, offset) in self.variables.iter().zip(&mut offsets) {
                if is_record(variable) == pass {
                    *offset = at;
                    let bytes = if pass { variable.bytes.len() / self.steps.max(1) } else { variable.bytes.len() };
                    at += bytes.next_multiple_of(4) as u64;
                }
            }
        }
        let mut out = self.header(&offsets);
        let fixed = self.variables.iter().filter(|variable| !is_record(variable));
        for variable in fixed {
            out.extend(&variable.bytes);
            out.resize(out.len().next_multiple_of(4), 0);
        }
        for step in 0..self.steps {
            for variable in self.variables.iter().filter(|variable| is_record(variable)) {
                let bytes = variable.bytes.len() / self.steps;
                out.extend(&variable.bytes[step * bytes..(step + 1) * bytes]);
            }
        }
        out
    }
}
