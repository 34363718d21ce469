//! Adds lightmaps to the objects of a baked scene, for Bevy 0.16 to 0.20 (compiled with 0.20.1).
//!
//! Call `app.add_plugins(BakerLightmapsPlugin { folder: "bevy".into() })`, and spawn `scene.glb` as usual. Each baked
//! scene has its own file: give the files different names.

use std::collections::HashMap;

use bevy::asset::AssetPath;
use bevy::gltf::GltfExtras;
use bevy::math::Rect;
use bevy::pbr::Lightmap;
use bevy::prelude::*;

/// A page times this number is the irradiance E in lx.
pub const PAGE_SCALE: f32 = /* scale */;

/// A page times this number is E / pi, the radiance in cd/m2 of a white surface.
pub const LIGHTMAP_EXPOSURE: f32 = PAGE_SCALE * std::f32::consts::FRAC_1_PI;

/// `Exposure { ev100: EV100 }` on the camera fits the scene to a display.
#[allow(dead_code)]
pub const EV100: f32 = /* ev100 */;

const PAGES: &[&str] = &[
    /* pages */
];

/// An object: index and name of its node, its page, and the rectangle of the page that its second uv set covers.
struct Baked {
    node: usize,
    name: &'static str,
    page: usize,
    min: [f32; 2],
    max: [f32; 2],
}

const OBJECTS: &[Baked] = &[
    /* objects */
];

pub struct BakerLightmapsPlugin {
    /// Folder of `scene.glb` and the pages, below `assets`.
    pub folder: String,
}

impl Plugin for BakerLightmapsPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(BakedScene {
            file: AssetPath::parse(&format!("{}/scene.glb", self.folder)).into_owned(),
            pages: PAGES.iter().map(|page| format!("{}/{page}", self.folder)).collect(),
            objects: OBJECTS.iter().map(|baked| (baked.name, baked)).collect(),
        });
        app.add_systems(Update, (add_lightmaps, exclude_baked_lights));
    }
}

#[derive(Resource)]
struct BakedScene {
    file: AssetPath<'static>,
    pages: Vec<String>,
    objects: HashMap<&'static str, &'static Baked>,
}

/// Adds `Lightmap` to each new mesh of the file. The parent of a mesh entity is its node.
#[allow(unused_mut)] // Bevy 0.19 and newer need the `mut` of `material`.
fn add_lightmaps(
    mut commands: Commands,
    added: Query<(Entity, &ChildOf, &Mesh3d, &MeshMaterial3d<StandardMaterial>), Added<Mesh3d>>,
    nodes: Query<(&Name, Option<&GltfExtras>)>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    assets: Res<AssetServer>,
    scene: Res<BakedScene>,
) {
    for (entity, parent, mesh, material) in &added {
        if !mesh.0.path().is_some_and(|path| path.without_label() == scene.file) {
            continue;
        }
        let Ok((name, extras)) = nodes.get(parent.parent()) else { continue };
        let Some(baked) = scene.objects.get(name.as_str()) else { continue };
        if node_index(extras).is_some_and(|node| node != baked.node) {
            continue;
        }
        if let Some(mut material) = materials.get_mut(&material.0) {
            material.lightmap_exposure = LIGHTMAP_EXPOSURE;
            // Metals have no diffuse colour in Bevy, but the bake treats every surface as diffuse.
            material.metallic = 0.0;
            // The camera's exposure applies to emission as it applies to the light of the pages.
            material.emissive_exposure_weight = 1.0;
        }
        commands.entity(entity).insert(Lightmap {
            image: assets.load(scene.pages[baked.page].clone()),
            uv_rect: Rect { min: Vec2::from_array(baked.min), max: Vec2::from_array(baked.max) },
            ..default()
        });
    }
}

/// Excludes lightmapped surfaces from the diffuse light of the file's lights, because the pages contain it.
fn exclude_baked_lights(
    mut points: Query<(&mut PointLight, &ChildOf), Added<PointLight>>,
    mut spots: Query<(&mut SpotLight, &ChildOf), Added<SpotLight>>,
    mut suns: Query<(&mut DirectionalLight, &ChildOf), Added<DirectionalLight>>,
    nodes: Query<(&Name, Option<&GltfExtras>)>,
) {
    let is_baked = |parent: &ChildOf| {
        nodes.get(parent.parent()).is_ok_and(|(name, extras)| {
            node_index(extras).is_some_and(|node| name.as_str().ends_with(&format!("_n{node}")))
        })
    };
    for (mut light, parent) in &mut points {
        light.affects_lightmapped_mesh_diffuse &= !is_baked(parent);
    }
    for (mut light, parent) in &mut spots {
        light.affects_lightmapped_mesh_diffuse &= !is_baked(parent);
    }
    for (mut light, parent) in &mut suns {
        light.affects_lightmapped_mesh_diffuse &= !is_baked(parent);
    }
}

/// Returns the node index that `scene.glb` stores as the last member of a node's extras.
fn node_index(extras: Option<&GltfExtras>) -> Option<usize> {
    let (_, rest) = extras?.value.rsplit_once("\"baker_node\":")?;
    rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}
