//! Adds lightmaps to the objects of a baked scene.
//!
//! Call `app.add_plugins(BakerLightmapsPlugin { folder: "bevy".into() })`, and spawn `scene.glb` as usual.

use bevy::math::Rect;
use bevy::pbr::Lightmap;
use bevy::prelude::*;

/// The pages contain irradiance E, which Bevy multiplies by the diffuse colour. The factor 1 / pi gives radiance.
const LIGHTMAP_EXPOSURE: f32 = std::f32::consts::FRAC_1_PI;

const PAGES: &[&str] = &[
    /* pages */
];

/// The page of an object, and the rectangle of the page that its second uv set covers.
struct Baked {
    name: &'static str,
    page: usize,
    min: [f32; 2],
    max: [f32; 2],
}

const OBJECTS: &[Baked] = &[
    /* objects */
];

pub struct BakerLightmapsPlugin {
    /// Folder of the pages below `assets`.
    pub folder: String,
}

impl Plugin for BakerLightmapsPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(BakerFolder(self.folder.clone())).add_systems(Update, add_lightmaps);
    }
}

#[derive(Resource)]
struct BakerFolder(String);

/// Adds `Lightmap` to each new mesh. A mesh entity is a child of its node, which has the unique name.
fn add_lightmaps(
    mut commands: Commands,
    added: Query<(Entity, &ChildOf, &MeshMaterial3d<StandardMaterial>), (With<Mesh3d>, Without<Lightmap>)>,
    names: Query<&Name>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    assets: Res<AssetServer>,
    folder: Res<BakerFolder>,
) {
    for (entity, parent, material) in &added {
        let Ok(name) = names.get(parent.parent()) else { continue };
        let Some(baked) = OBJECTS.iter().find(|baked| baked.name == name.as_str()) else { continue };
        let Some(material) = materials.get_mut(&material.0) else { continue };
        material.lightmap_exposure = LIGHTMAP_EXPOSURE;
        // Metals have no diffuse colour in Bevy, but the bake treats every surface as diffuse.
        material.metallic = 0.0;
        commands.entity(entity).insert(Lightmap {
            image: assets.load(format!("{}/{}", folder.0, PAGES[baked.page])),
            uv_rect: Rect { min: Vec2::from_array(baked.min), max: Vec2::from_array(baked.max) },
            ..default()
        });
    }
}
