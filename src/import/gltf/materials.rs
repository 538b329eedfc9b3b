//! The materials of a document in, their base colours out.

use serde::Deserialize;

use super::document::Document;
use crate::import::Material;
use crate::import::attributes::srgb_from_linear;

/// The extension whose diffuse colour stands for the base colour.
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// All materials of the document, behind the default one.
pub fn read(document: &Document<'_>) -> Vec<Material> {
    let diffuse = diffuse_factors(document);
    let own = document.root.materials.iter().enumerate().map(|(index, material)| {
        let base = material.pbr_metallic_roughness.base_color_factor.0;
        let factor = diffuse.get(index).copied().flatten().unwrap_or(base);
        Material { name: material.name.clone().unwrap_or_default(), base_colour: srgb_from_linear(factor) }
    });
    std::iter::once(Material::default()).chain(own).collect()
}

/// The little of the JSON that the `gltf` crate drops.
#[derive(Deserialize)]
struct Extra {
    #[serde(default)]
    materials: Vec<ExtraMaterial>,
}

#[derive(Deserialize)]
struct ExtraMaterial {
    #[serde(default)]
    extensions: ExtraExtensions,
}

#[derive(Default, Deserialize)]
struct ExtraExtensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Deserialize)]
struct SpecularGlossiness {
    #[serde(rename = "diffuseFactor", default = "white")]
    diffuse_factor: [f32; 4],
}

fn white() -> [f32; 4] {
    [1.0; 4]
}

/// The diffuse colour of each material that has one; nothing if the extension is not used, or not understood.
fn diffuse_factors(document: &Document<'_>) -> Vec<Option<[f32; 4]>> {
    if !document.root.extensions_used.iter().any(|name| name == SPECULAR_GLOSSINESS) {
        return Vec::new();
    }
    let extra = serde_json::from_slice(document.text).unwrap_or(Extra { materials: Vec::new() });
    let factor = |material: ExtraMaterial| material.extensions.specular_glossiness.map(|s| s.diffuse_factor);
    extra.materials.into_iter().map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::super::document;
    use super::*;

    #[test]
    fn base_colours_become_srgb() {
        let text = br#"{"asset":{"version":"2.0"},"extensionsUsed":["KHR_materials_pbrSpecularGlossiness"],"materials":[
            {"name":"a","pbrMetallicRoughness":{"baseColorFactor":[1,0.215861,0,0.5]}},
            {"extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0,0,1,1]}}},{}]}"#;
        let materials = read(&document::parse(text).unwrap());
        let colours: Vec<_> = materials.iter().map(|m| m.base_colour).collect();
        assert_eq!(
            colours,
            [Material::default().base_colour, [255, 128, 0, 128], [0, 0, 255, 255], [255; 4]]
        );
        assert_eq!(materials[1].name, "a");
    }
}
