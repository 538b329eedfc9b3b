//! An accessor in, its numbers out one element at a time, every byte of them known to be there.

use std::rc::Rc;

use ::gltf::json::Index;
use ::gltf::json::Root;
use ::gltf::json::accessor::{Accessor, ComponentType, Type, sparse::Sparse};
use ::gltf::json::buffer::View;
use ::gltf::json::validation::Checked;
use rustc_hash::FxHashMap;

use super::buffers::Buffers;
use crate::import::Problem;

/// Readers of all accessors asked for so far.
pub struct Accessors<'a> {
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    readers: FxHashMap<usize, Rc<Reader<'a>>>,
    /// Bytes of the buffers that readers which were asked for reach over.
    pub bytes_reached: u64,
}

impl<'a> Accessors<'a> {
    /// No readers yet.
    pub fn new(root: &'a Root, buffers: &'a Buffers<'a>) -> Self {
        Self { root, buffers, readers: FxHashMap::default(), bytes_reached: 0 }
    }

    /// The reader of an accessor.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] if it is not there, or promises more than its buffer holds.
    pub fn get(&mut self, index: usize) -> Result<Rc<Reader<'a>>, Problem> {
        let reader = match self.readers.get(&index) {
            Some(reader) => Rc::clone(reader),
            None => self.open(index)?,
        };
        self.bytes_reached += reader.elements.map_or(0, |elements| elements.bytes.len() as u64);
        Ok(reader)
    }

    fn open(&mut self, index: usize) -> Result<Rc<Reader<'a>>, Problem> {
        let malformed = |what: String| Problem::Malformed(format!("accessor {index} {what}"));
        let accessor = self.root.accessors.get(index).ok_or_else(|| malformed("is not there".to_owned()))?;
        let reader = Reader::new(accessor, self.root, self.buffers).map_err(|fault| match fault {
            Fault::View(problem) => problem,
            Fault::Accessor(what) => malformed(what),
        })?;
        let reader = Rc::new(reader);
        self.readers.insert(index, Rc::clone(&reader));
        Ok(reader)
    }
}

/// Why an accessor cannot be read.
enum Fault {
    /// The problem is in a buffer view.
    View(Problem),
    /// It is in the accessor.
    Accessor(String),
}

impl From<Problem> for Fault {
    fn from(problem: Problem) -> Self {
        Self::View(problem)
    }
}

/// Reads one accessor.
pub struct Reader<'a> {
    /// How many elements it has.
    pub count: usize,
    /// How many numbers an element has.
    pub components: usize,
    layout: Layout,
    /// `None`: all zeros.
    elements: Option<Elements<'a>>,
    /// Elements that differ from `elements`: where, and their place in `replacements`; sorted by the first.
    replaced: Vec<(u32, u32)>,
    replacements: Option<Elements<'a>>,
}

/// How a number is stored.
#[derive(Clone, Copy)]
struct Layout {
    component: ComponentType,
    normalized: bool,
    element_bytes: usize,
}

/// Elements at equal distances, all within `bytes`.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Elements<'a> {
    /// Checks that `count` elements lie in the view from `offset` on.
    fn new(
        (view, stride): (&'a [u8], Option<usize>),
        offset: u64,
        count: usize,
        element_bytes: usize,
    ) -> Result<Self, Fault> {
        let stride = stride.unwrap_or(element_bytes);
        if stride < element_bytes {
            return Err(Fault::Accessor(format!(
                "has elements of {element_bytes} bytes every {stride} bytes"
            )));
        }
        let span = if count == 0 {
            Some(0)
        } else {
            (count - 1).checked_mul(stride).and_then(|s| s.checked_add(element_bytes))
        };
        let range = usize::try_from(offset).ok().zip(span);
        let bytes = range.and_then(|(offset, span)| view.get(offset..offset.checked_add(span)?));
        let lies = || {
            let held = view.len();
            format!(
                "promises {count} elements of {element_bytes} bytes, but its buffer view holds {held} bytes"
            )
        };
        Ok(Self { bytes: bytes.ok_or_else(|| Fault::Accessor(lies()))?, stride })
    }

    fn get(&self, element: usize, element_bytes: usize) -> &'a [u8] {
        let start = element * self.stride;
        &self.bytes[start..start + element_bytes]
    }
}

impl<'a> Reader<'a> {
    fn new(accessor: &Accessor, root: &'a Root, buffers: &'a Buffers<'a>) -> Result<Self, Fault> {
        let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_)
        else {
            return Err(Fault::Accessor("has an unknown type".to_owned()));
        };
        let components = match shape {
            Type::Scalar => 1,
            Type::Vec2 => 2,
            Type::Vec3 => 3,
            Type::Vec4 => 4,
            _ => return Err(Fault::Accessor("is a matrix, which no vertex attribute is".to_owned())),
        };
        let element_bytes = component.0.size() * components;
        let layout = Layout { component: component.0, normalized: accessor.normalized, element_bytes };
        let too_many = || Fault::Accessor(format!("promises {} elements", accessor.count.0));
        let count = u32::try_from(accessor.count.0).map_err(|_| too_many())? as usize;
        let elements = match accessor.buffer_view {
            Some(index) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                Some(Elements::new(buffers.view(root, index)?, offset, count, element_bytes)?)
            }
            // Zeros that no data stand behind: enough for any use of the data that there are.
            None if count <= buffers.total_bytes() => None,
            None => return Err(too_many()),
        };
        let mut reader =
            Self { count, components, layout, elements, replaced: Vec::new(), replacements: None };
        if let Some(sparse) = &accessor.sparse {
            reader.replace(sparse, root, buffers)?;
        }
        Ok(reader)
    }

    /// Reads which elements a sparse accessor replaces.
    fn replace(&mut self, sparse: &Sparse, root: &'a Root, buffers: &'a Buffers<'a>) -> Result<(), Fault> {
        let Checked::Valid(component) = &sparse.indices.component_type else {
            return Err(Fault::Accessor("has sparse indices of an unknown type".to_owned()));
        };
        let component = component.0;
        let count = usize::try_from(sparse.count.0).ok().filter(|&count| count <= self.count);
        let count = count.ok_or_else(|| Fault::Accessor("replaces more elements than it has".to_owned()))?;
        let view = |index: Index<View>| buffers.view(root, index);
        let size = component.size();
        let indices =
            Elements::new(view(sparse.indices.buffer_view)?, sparse.indices.byte_offset.0, count, size)?;
        let bytes = self.layout.element_bytes;
        let values =
            Elements::new(view(sparse.values.buffer_view)?, sparse.values.byte_offset.0, count, bytes)?;
        self.replaced = (0..count).map(|i| (unsigned(indices.get(i, size), component), i as u32)).collect();
        self.replaced.sort_unstable();
        self.replacements = Some(values);
        Ok(())
    }

    /// The bytes of an element below `count`; `None` for zeros.
    fn element(&self, index: usize) -> Option<&'a [u8]> {
        let bytes = self.layout.element_bytes;
        if let Some(replacements) = &self.replacements {
            let found = self.replaced.binary_search_by_key(&index, |&(place, _)| place as usize);
            if let Ok(found) = found {
                return Some(replacements.get(self.replaced[found].1 as usize, bytes));
            }
        }
        self.elements.map(|elements| elements.get(index, bytes))
    }

    /// An element below `count` as up to four numbers, normalised integers in -1..1; absent components are 0.
    pub fn vector(&self, index: usize) -> [f32; 4] {
        let mut vector = [0.0; 4];
        if let Some(bytes) = self.element(index) {
            let size = self.layout.component.size();
            for (slot, bytes) in vector.iter_mut().zip(bytes.chunks_exact(size)) {
                *slot = self.layout.number(bytes);
            }
        }
        vector
    }

    /// The first three numbers of an element below `count`.
    pub fn triple(&self, index: usize) -> [f32; 3] {
        let [x, y, z, _] = self.vector(index);
        [x, y, z]
    }

    /// An element below `count` of an accessor of indices.
    pub fn index(&self, index: usize) -> u32 {
        self.element(index).map_or(0, |bytes| unsigned(bytes, self.layout.component))
    }

    /// Whether this can be an accessor of indices.
    pub fn is_of_indices(&self) -> bool {
        use ComponentType::{U8, U16, U32};
        self.components == 1 && matches!(self.layout.component, U8 | U16 | U32)
    }

    /// Whether numbers are integers that stand for themselves.
    pub fn is_of_plain_integers(&self) -> bool {
        !self.layout.normalized && self.layout.component != ComponentType::F32
    }
}

impl Layout {
    /// One number of an attribute, by the equations of glTF 2.0, section 3.6.2.2.
    fn number(self, bytes: &[u8]) -> f32 {
        let (value, greatest) = match (self.component, bytes) {
            (ComponentType::I8, &[a]) => (f32::from(a as i8), 127.0),
            (ComponentType::U8, &[a]) => (f32::from(a), 255.0),
            (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (ComponentType::U16, &[a, b]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (ComponentType::U32, &[a, b, c, d]) => (u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32),
            (ComponentType::F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
            _ => (0.0, 1.0),
        };
        if self.normalized { (value / greatest).max(-1.0) } else { value }
    }
}

/// An unsigned integer; no index at all (the greatest number) for other types.
fn unsigned(bytes: &[u8], component: ComponentType) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    }
}
