//! The buffers that a document names in, their bytes out.

use std::cell::{Cell, OnceCell};
use std::path::{Path, PathBuf};

use ::gltf::json::{Buffer, Index, Root, buffer::View};
use rustc_hash::FxHashMap;

use super::base64;
use super::compressed::{self, Compressed};
use super::document::Document;
use crate::import::input::{Bytes, Limit, memory_at_hand};
use crate::import::notes::quoted;
use crate::import::{Problem, folder};

/// The bytes of all buffers.
pub struct Buffers<'a> {
    contents: Vec<Content<'a>>,
    /// For each buffer its place in `contents` (several may share one file) and its length.
    buffers: Vec<(usize, usize)>,
    compressed: Compressed,
    /// The decoded bytes of each buffer view that is compressed and was asked for.
    decoded: Vec<OnceCell<Result<Vec<u8>, String>>>,
    /// How many more bytes may be decoded.
    decoded_left: Cell<u64>,
}

/// Where the bytes of buffers are.
enum Content<'a> {
    OfDocument(&'a [u8]),
    Own(Bytes),
}

impl std::ops::Deref for Content<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::OfDocument(bytes) => bytes,
            Self::Own(bytes) => bytes,
        }
    }
}

/// Fetches all buffers of a document that was read from `path`: the binary chunk, `data:` URIs, and files in
/// the model's own folder.
///
/// # Errors
///
/// [`Problem::Reference`] for a file that is missing or elsewhere, [`Problem::Malformed`] for a buffer that
/// holds less than the document says.
pub fn load<'a>(document: &Document<'a>, path: &Path) -> Result<Buffers<'a>, Problem> {
    let mut buffers = Buffers {
        contents: vec![Content::OfDocument(document.blob.unwrap_or_default())],
        buffers: Vec::new(),
        compressed: Compressed::of(document)?,
        decoded: vec![OnceCell::new(); document.root.buffer_views.len()],
        decoded_left: Cell::new(0),
    };
    let mut files = FxHashMap::default();
    for (index, buffer) in document.root.buffers.iter().enumerate() {
        let place = match &buffer.uri {
            _ if buffers.compressed.is_fallback(index) => {
                // The bytes that it stands for are in compressed views.
                buffers.buffers.push((0, 0));
                continue;
            }
            Some(uri) => buffers.fetch(uri, path, &mut files)?,
            None => 0,
        };
        let found = buffers.contents[place].len();
        let length = usize::try_from(buffer.byte_length.0).ok().filter(|&length| length <= found);
        let Some(length) = length else {
            let declared = buffer.byte_length.0;
            let what = format!(
                "buffer {index} is cut short: it should have {declared} bytes, but there are {found}"
            );
            return Err(Problem::Malformed(what));
        };
        buffers.buffers.push((place, length));
    }
    buffers.decoded_left.set(Limit::of(buffers.content_bytes() as u64, memory_at_hand()).bytes);
    Ok(buffers)
}

impl Buffers<'_> {
    /// Adds what the URI refers to; returns its place.
    fn fetch(
        &mut self,
        uri: &str,
        from: &Path,
        files: &mut FxHashMap<PathBuf, usize>,
    ) -> Result<usize, Problem> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
            let decoded = encoded.and_then(|encoded| base64::decode(encoded.as_bytes()));
            let bytes = decoded.ok_or_else(|| {
                Problem::Malformed(format!("the data of a buffer is not base64: {}", quoted(uri)))
            })?;
            self.contents.push(Content::Own(Bytes::Held(bytes)));
            return Ok(self.contents.len() - 1);
        }
        let file = folder::resolve(from, uri).or_else(|_| folder::resolve(from, &percent_decoded(uri)))?;
        if let Some(&place) = files.get(&file) {
            return Ok(place);
        }
        self.contents.push(Content::Own(Bytes::mapped(&file)?));
        files.insert(file, self.contents.len() - 1);
        Ok(self.contents.len() - 1)
    }

    /// Gives back the memory of what was read of files beside the document.
    pub fn release(&self) {
        for content in &self.contents {
            if let Content::Own(bytes) = content {
                bytes.release();
            }
        }
    }

    /// How many bytes there are in all, and elements of compressed views.
    pub fn total_bytes(&self) -> usize {
        // No more elements than data could mean: the document may promise any number.
        let bytes = self.content_bytes();
        bytes + self.compressed.element_count().min(bytes.saturating_mul(4))
    }

    fn content_bytes(&self) -> usize {
        self.contents.iter().map(|content| content.len()).sum()
    }

    /// The bytes of a buffer view, and its stride if it has one.
    pub fn view(&self, root: &Root, index: Index<View>) -> Result<(&[u8], Option<usize>), Problem> {
        let malformed = |what: &str| Problem::Malformed(format!("buffer view {index} {what}"));
        let view = root.buffer_views.get(index.value()).ok_or_else(|| malformed("is not there"))?;
        let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0);
        if let Some(compressed) = self.compressed.view(index.value()) {
            let decoded = self.decoded[index.value()].get_or_init(|| self.decode(compressed));
            return decoded.as_ref().map(|bytes| (&bytes[..], stride)).map_err(|what| malformed(what));
        }
        let bytes = self.buffer(view.buffer).ok_or_else(|| malformed("names a buffer that is not there"))?;
        let offset = usize::try_from(view.byte_offset.map_or(0, |offset| offset.0)).ok();
        let length = usize::try_from(view.byte_length.0).ok();
        let range =
            offset.zip(length).and_then(|(offset, length)| bytes.get(offset..offset.checked_add(length)?));
        let range = range.ok_or_else(|| {
            let (length, whole) = (view.byte_length.0, bytes.len());
            malformed(&format!("of {length} bytes lies beyond the end of its buffer of {whole}"))
        })?;
        Ok((range, stride))
    }

    /// Decodes a compressed view.
    fn decode(&self, view: &compressed::View) -> Result<Vec<u8>, String> {
        let buffer =
            self.buffer(Index::new(view.buffer as u32)).filter(|_| u32::try_from(view.buffer).is_ok());
        let range = view.byte_offset.checked_add(view.byte_length).map(|end| view.byte_offset..end);
        let bytes = buffer.zip(range).and_then(|(buffer, range)| buffer.get(range));
        let bytes = bytes.ok_or("has compressed data that lie beyond the end of their buffer")?;
        let length = view.decoded_bytes(bytes)?;
        let left = self.decoded_left.get().checked_sub(length);
        self.decoded_left
            .set(left.ok_or("unpacks, with those before it, to more than the memory at hand allows")?);
        view.decode(bytes)
    }

    fn buffer(&self, index: Index<Buffer>) -> Option<&[u8]> {
        let &(place, length) = self.buffers.get(index.value())?;
        self.contents[place].get(..length)
    }
}

/// Replaces `%` and two hexadecimal digits by the byte they stand for.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let digits = tail.first_chunk::<2>().filter(|_| *first == b'%');
        let decoded = digits.and_then(|[high, low]| {
            let digit = |c: &u8| char::from(*c).to_digit(16);
            Some((digit(high)? * 16 + digit(low)?) as u8)
        });
        bytes.push(decoded.unwrap_or(*first));
        rest = if decoded.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_signs_are_decoded() {
        assert_eq!(percent_decoded("a%20b%2Fc%c3%a9%"), "a b/cé%");
        assert_eq!(percent_decoded("%%41%4"), "%A%4");
    }
}
