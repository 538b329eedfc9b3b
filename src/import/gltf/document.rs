//! The bytes of a file in, its JSON as structures and its binary chunk out.

use ::gltf::binary::Glb;
use ::gltf::json::{Root, Value};
use serde::de::DeserializeOwned;

use crate::import::Problem;
use crate::import::notes::quoted;

/// A file's content.
pub struct Document<'a> {
    /// The JSON.
    pub root: Root,
    /// The JSON text.
    pub text: &'a [u8],
    /// The binary chunk of a GLB.
    pub blob: Option<&'a [u8]>,
}

impl Document<'_> {
    /// What an extension adds to the tables, read from the text; nothing if the document does not use it.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] if it is used and makes no sense.
    pub fn extension<T: Default + DeserializeOwned>(&self, names: &[&str]) -> Result<T, Problem> {
        let mut used = self.root.extensions_used.iter().chain(&self.root.extensions_required);
        if !used.any(|name| names.contains(&name.as_str())) {
            return Ok(T::default());
        }
        serde_json::from_slice(self.text).map_err(|error| {
            Problem::Malformed(format!(
                "the JSON of {} is malformed ({error})",
                names.first().unwrap_or(&"an extension")
            ))
        })
    }
}

/// Extensions that may be required because what they change is read (quantised attributes, compressed views, copies of
/// meshes) or is not drawn (textures, lights); so are all whose name begins with [`MATERIALS`].
const HARMLESS: [&str; 10] = [
    super::instancing::EXTENSION,
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "MSFT_texture_dds",
    "KHR_lights_punctual",
    "KHR_xmp_json_ld",
];

/// Extensions of materials change how a surface shines, never where it is.
const MATERIALS: &str = "KHR_materials_";

/// The tables that are read; the rest of a file may be as broken as it likes.
const TABLES: [&str; 11] = [
    "asset",
    "accessors",
    "buffers",
    "bufferViews",
    "scene",
    "scenes",
    "nodes",
    "meshes",
    "materials",
    "extensionsUsed",
    "extensionsRequired",
];

/// Takes a file apart, GLB or plain JSON, whatever its name says.
///
/// # Errors
///
/// [`Problem::Malformed`] for a container or JSON that cannot be read, or another version of glTF;
/// [`Problem::Extension`].
pub fn parse(bytes: &[u8]) -> Result<Document<'_>, Problem> {
    let (text, blob) = if bytes.starts_with(b"glTF") { split_glb(bytes)? } else { (bytes, None) };
    let root = parse_json(text)?;
    if !root.asset.version.starts_with("2.") {
        let version = quoted(&root.asset.version);
        return Err(Problem::Malformed(format!("this is glTF of version {version}; only 2.x can be read")));
    }
    let supported = |name: &str| HARMLESS.contains(&name) || name.starts_with(MATERIALS);
    match root.extensions_required.iter().find(|name| !supported(name)) {
        Some(name) => Err(Problem::Extension(name.chars().take(100).collect())),
        None => Ok(Document { root, text, blob }),
    }
}

/// The word at a place of a GLB; `None` beyond its end.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

/// How long the JSON of a file says that it is, at most as long as the file.
pub fn text_bytes(bytes: &[u8]) -> u64 {
    let declared = word(bytes, 12).filter(|_| bytes.starts_with(b"glTF")).map_or(u64::MAX, u64::from);
    declared.min(bytes.len() as u64)
}

/// The JSON and the binary chunk of a GLB.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Problem> {
    let malformed = |what: String| Problem::Malformed(format!("the GLB container is malformed ({what})"));
    let (Some(_version), Some(declared)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(malformed("its header is cut short".to_owned()));
    };
    let declared = declared as usize;
    if declared > bytes.len() {
        let found = bytes.len();
        return Err(malformed(format!(
            "it is truncated: its header says {declared} bytes, but there are {found}"
        )));
    }
    // The crate subtracts the header's 12 bytes unchecked.
    if declared < 20 {
        return Err(malformed(format!("its header says {declared} bytes, too few for any content")));
    }
    let glb = Glb::from_slice(&bytes[..declared]).map_err(|error| malformed(readable(&error)))?;
    // Lengths checked by the crate, the chunks are slices of `bytes`; it hides that behind a `Cow`.
    let borrowed = |chunk| match chunk {
        std::borrow::Cow::Borrowed(slice) => Ok(slice),
        std::borrow::Cow::Owned(_) => Err(malformed("its chunks cannot be borrowed".to_owned())),
    };
    Ok((borrowed(glb.json)?, glb.bin.map(borrowed).transpose()?))
}

/// The crate's message without its debug output.
fn readable(error: &::gltf::Error) -> String {
    match error {
        ::gltf::Error::Binary(binary) => binary.to_string(),
        other => other.to_string(),
    }
}

/// Reads the JSON; if the crate refuses it for a table that is not used here, without those tables.
fn parse_json(text: &[u8]) -> Result<Root, Problem> {
    let first = match ::gltf::json::deserialize::from_slice(text) {
        Ok(root) => return Ok(root),
        Err(error) => error,
    };
    let malformed = || Problem::Malformed(format!("the JSON is malformed ({first})"));
    let mut value: Value = ::gltf::json::deserialize::from_slice(text).map_err(|_| malformed())?;
    let tables = value.as_object_mut().ok_or_else(malformed)?;
    tables.retain(|name, _| TABLES.contains(&name.as_str()));
    let scenes = tables.get_mut("scenes").and_then(Value::as_array_mut);
    for scene in scenes.into_iter().flatten().filter_map(Value::as_object_mut) {
        // A scene without nodes is valid, but not to the crate.
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    ::gltf::json::deserialize::from_value(value).map_err(|_| malformed())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: &[u8]) -> String {
        parse(bytes).err().unwrap().to_string()
    }

    #[test]
    fn every_prefix_of_a_glb_is_an_error() {
        let json = br#"{"asset":{"version":"2.0"}}  "#;
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((20 + json.len() as u32).to_le_bytes());
        glb.extend((json.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(json);
        assert!(parse(&glb).is_ok());
        for length in 1..glb.len() {
            let text = message(&glb[..length]);
            assert!(text.contains("malformed"), "{length}: {text}");
        }
        for length in 0..20u32 {
            glb[8..12].copy_from_slice(&length.to_le_bytes());
            assert!(message(&glb).contains("too few"));
        }
    }

    #[test]
    fn unknown_requirements_and_versions_are_named() {
        let text = br#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}"#;
        assert_eq!(message(text), "requires KHR_draco_mesh_compression, which is not supported");
        let text = br#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_mesh_quantization","KHR_materials_unlit"]}"#;
        assert!(parse(text).is_ok());
        assert_eq!(
            message(br#"{"asset":{"version":"1.0"}}"#),
            "this is glTF of version \"1.0\"; only 2.x can be read"
        );
    }

    #[test]
    fn tables_that_are_not_read_may_be_broken() {
        let text = br#"{"asset":{"version":"2.0"},"textures":[{"sampler":0}],"scenes":[{"name":"none"}]}"#;
        let document = parse(text).unwrap();
        assert_eq!(document.root.scenes.len(), 1);
        assert!(message(br#"{"asset":{"version":"2.0"},"nodes":7}"#).starts_with("the JSON is malformed"));
        assert!(message(&b"[".repeat(100_000)).starts_with("the JSON is malformed"));
    }
}
