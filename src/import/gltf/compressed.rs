//! Buffer views compressed by meshoptimizer in (`EXT_meshopt_compression`, `KHR_meshopt_compression`), their bytes
//! out.
//!
//! The decoders of the `meshopt` crate are safe on any bytes, but they allocate what they are told to decode, and take
//! some of their arguments for granted: all of that is checked here before. What comes out may be garbage, and is
//! checked where it is used, like any other.

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use serde::Deserialize;

use super::document::Document;
use crate::import::Problem;

/// The names of the extension.
pub const EXTENSIONS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// What the extension says, of every buffer view and buffer.
#[derive(Default, Deserialize)]
pub struct Compressed {
    #[serde(default, rename = "bufferViews")]
    views: Vec<Extended<View>>,
    #[serde(default)]
    buffers: Vec<Extended<Fallback>>,
}

/// An object that may have the extension.
#[derive(Deserialize)]
struct Extended<T> {
    #[serde(default = "none")]
    extensions: Option<Extensions<T>>,
}

#[derive(Deserialize)]
struct Extensions<T> {
    #[serde(default = "none", rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    compression: Option<T>,
}

fn none<T>() -> Option<T> {
    None
}

/// A compressed buffer view.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct View {
    /// The buffer with the compressed bytes, and where they are in it.
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    /// Bytes of one element.
    pub byte_stride: usize,
    /// How many elements there are.
    pub count: usize,
    mode: String,
    #[serde(default)]
    filter: Option<String>,
}

#[derive(Deserialize)]
struct Fallback {
    #[serde(default)]
    fallback: bool,
}

impl Compressed {
    /// Reads the extension; nothing if the document does not use it.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] if it is used and makes no sense.
    pub fn of(document: &Document<'_>) -> Result<Self, Problem> {
        document.extension(&EXTENSIONS)
    }

    /// The extension of a buffer view.
    pub fn view(&self, index: usize) -> Option<&View> {
        self.views.get(index)?.extensions.as_ref()?.compression.as_ref()
    }

    /// Whether a buffer only stands for uncompressed bytes that may not be there.
    pub fn is_fallback(&self, buffer: usize) -> bool {
        let extension =
            self.buffers.get(buffer).and_then(|buffer| buffer.extensions.as_ref()?.compression.as_ref());
        extension.is_some_and(|extension| extension.fallback)
    }

    /// How many elements all compressed views promise.
    pub fn element_count(&self) -> usize {
        let views = self.views.iter().filter_map(|view| view.extensions.as_ref()?.compression.as_ref());
        views.map(|view| view.count).fold(0, usize::saturating_add)
    }
}

/// Vertices are coded in blocks of at most this many; a block takes a byte at least for four bytes of a vertex.
const MAX_BLOCK_VERTICES: usize = 256;

/// The largest vertex that the codec takes.
const MAX_STRIDE: usize = 256;

impl View {
    /// How many bytes the view decodes to.
    ///
    /// # Errors
    ///
    /// That it promises more than the compressed bytes can hold.
    pub fn decoded_bytes(&self, bytes: &[u8]) -> Result<u64, String> {
        let length = bytes.len();
        let most = match self.mode.as_str() {
            "ATTRIBUTES" => length.saturating_mul(4).div_ceil(self.byte_stride.max(1)) * MAX_BLOCK_VERTICES,
            // A byte a triangle; a byte an index.
            "TRIANGLES" => length.saturating_mul(3),
            "INDICES" => length,
            // Refused when it comes to decoding.
            _ => self.count,
        };
        let decoded = (self.count as u64).checked_mul(self.byte_stride as u64);
        let what =
            || format!("promises {} compressed elements, more than {length} bytes can hold", self.count);
        decoded.filter(|_| self.count <= most).ok_or_else(what)
    }

    /// Decodes the view's bytes, whose [`View::decoded_bytes`] are known.
    ///
    /// # Errors
    ///
    /// What is wrong, in words that go behind "buffer view 7".
    pub fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let Self { count, byte_stride: stride, .. } = *self;
        let decoded = match (self.mode.as_str(), stride) {
            ("ATTRIBUTES", _) => decode_vertices(bytes, count, stride)?,
            ("TRIANGLES", 2 | 4) if !count.is_multiple_of(3) => {
                Err("has triangles of fewer than three corners".to_owned())?
            }
            ("TRIANGLES", 2) => meshopt::decode_index_buffer::<u16>(bytes, count).map(to_bytes),
            ("TRIANGLES", 4) => meshopt::decode_index_buffer::<u32>(bytes, count).map(to_bytes),
            ("INDICES", 2) => meshopt::decode_index_sequence::<u16>(bytes, count).map(to_bytes),
            ("INDICES", 4) => meshopt::decode_index_sequence::<u32>(bytes, count).map(to_bytes),
            (mode, _) => Err(format!(
                "is compressed in the mode {mode:?} with elements of {stride} bytes, which there is not"
            ))?,
        };
        let mut decoded = decoded.map_err(|_| "has compressed data that are damaged".to_owned())?;
        self.unfilter(&mut decoded)?;
        Ok(decoded)
    }

    /// Undoes the filter in place.
    fn unfilter(&self, bytes: &mut [u8]) -> Result<(), String> {
        let filter = self.filter.as_deref().unwrap_or("NONE");
        match (filter, self.byte_stride) {
            ("NONE", _) => {}
            ("OCTAHEDRAL", 4) => meshopt::decode_filter_oct::<i8>(cast_slice_mut(bytes)),
            ("OCTAHEDRAL", 8) => in_words(bytes, |words: &mut [[i16; 4]]| meshopt::decode_filter_oct(words)),
            ("QUATERNION", 8) => in_words(bytes, |words: &mut [[i16; 4]]| meshopt::decode_filter_quat(words)),
            ("EXPONENTIAL", stride) if stride.is_multiple_of(4) => {
                in_words(bytes, |words: &mut [[u32; 1]]| meshopt::decode_filter_exp(words));
            }
            ("COLOR", 4) => meshopt::decode_filter_color::<u8>(cast_slice_mut(bytes)),
            ("COLOR", 8) => in_words(bytes, |words: &mut [[u16; 4]]| meshopt::decode_filter_color(words)),
            (_, stride) => {
                return Err(format!(
                    "is filtered by {filter:?} with elements of {stride} bytes, which there is not"
                ));
            }
        }
        Ok(())
    }
}

fn to_bytes<T: Pod>(numbers: Vec<T>) -> Vec<u8> {
    cast_slice(&numbers).to_vec()
}

/// Works on bytes as words, in a copy, since bytes may lie anywhere.
fn in_words<T: Pod>(bytes: &mut [u8], work: impl FnOnce(&mut [T])) {
    let mut words: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
    work(&mut words);
    bytes.copy_from_slice(cast_slice(&words));
}

/// A vertex of `WORDS` times four bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct Vertex<const WORDS: usize>([u32; WORDS]);

impl<const WORDS: usize> Default for Vertex<WORDS> {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

fn decode_words<const WORDS: usize>(bytes: &[u8], count: usize) -> meshopt::Result<Vec<u8>> {
    meshopt::decode_vertex_buffer::<Vertex<WORDS>>(bytes, count).map(to_bytes)
}

/// Decodes vertices, whose size the crate wants as a type.
fn decode_vertices(bytes: &[u8], count: usize, stride: usize) -> Result<meshopt::Result<Vec<u8>>, String> {
    macro_rules! by_words {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words if stride.is_multiple_of(4) => Ok(decode_words::<$words>(bytes, count)),)*
                _ => Err(format!("has vertices of {stride} bytes; there can be 4, 8 and so on up to {MAX_STRIDE}")),
            }
        };
    }
    by_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}
