// Uses the menu of the package in a project with two baked levels, the folders given as arguments.
// Prints what a user sees and what the renderers got.
using System;
using System.Linq;
using Baker;
using UnityEditor;
using UnityEditor.Build.Reporting;
using UnityEngine;
using UnityEngine.SceneManagement;

internal static class Use
{
    private static GameObject Child(GameObject parent, string name)
    {
        GameObject made = new GameObject(name);
        made.transform.SetParent(parent.transform);
        return made;
    }

    // As an importer makes it: node 0 holds nothing, node 1 has its renderer, node 2 has one for each primitive.
    private static GameObject Place(string folder)
    {
        GameObject root = new GameObject("scene");
        AssetDatabase.Paths[root] = folder + "/scene.glb";
        Child(root, "empty_n0").AddComponent<Renderer>();
        Child(root, "wall_north_side_n1").AddComponent<Renderer>();
        GameObject second = Child(root, "wall_north_side_n2");
        Child(second, "first").AddComponent<Renderer>();
        Child(second, "second").AddComponent<Renderer>();
        Child(root, "lamp_n3").AddComponent<Light>().enabled = true;
        return root;
    }

    private static void AddPages(string folder, int count)
    {
        for (int i = 0; i < count; i++)
        {
            string path = folder + "/irradiance_" + i + ".exr";
            AssetImporter.All[path] = new TextureImporter();
            AssetDatabase.Assets[path] =
                new Texture2D(1, 1, TextureFormat.RGBAHalf, false, true) { name = path };
        }
    }

    private static void Apply(string title, GameObject root)
    {
        Console.WriteLine("# " + title);
        Selection.activeGameObject = root;
        BakerLightmapsMenu.ApplyToSelection();
        Console.WriteLine("lightmaps " + LightmapSettings.lightmaps.Length);
        GameObject whole = PrefabUtility.GetNearestPrefabInstanceRoot(root);
        foreach (Renderer renderer in whole.GetComponentsInChildren<Renderer>(true))
        {
            Vector4 st = renderer.lightmapScaleOffset;
            Console.WriteLine(string.Join(" ", renderer.name, renderer.lightmapIndex, st.x, st.y, st.z, st.w));
        }
    }

    private static void Main(string[] folders)
    {
        Texture2D own = new Texture2D(1, 1, TextureFormat.RGBAHalf, false, true);
        LightmapSettings.lightmaps = new[] { new LightmapData { lightmapColor = own } };
        foreach (string name in new[] { "m_LightmapStripping", "m_LightmapKeepPlain", "m_LightmapKeepDirCombined" })
            SerializedObject.Stored[name] = new SerializedProperty { boolValue = true };
        AssetDatabase.Assets["ProjectSettings/GraphicsSettings.asset"] = own;

        Apply("nothing from a bake", new GameObject("cube"));
        GameObject first = Place(folders[0]), second = Place(folders[1]);
        AddPages(folders[0], 2);
        AddPages(folders[1], 1);
        Apply("first level", first.transform.Children[2].Owner.transform.Children[0].Owner);
        Apply("first level", first);
        Console.WriteLine("keep " + SerializedObject.Stored["m_LightmapStripping"].intValue);
        LightmapShaders.Keep();
        Console.WriteLine("keep " + SerializedObject.Stored["m_LightmapStripping"].intValue);
        // The user prefers another compression, and the next bake has pages of twice the size.
        TextureImporter changed = (TextureImporter)AssetImporter.All[folders[0] + "/irradiance_0.exr"];
        changed.textureCompression = TextureImporterCompression.Uncompressed;
        changed.maxTextureSize /= 2;
        Apply("first level again", first);
        Apply("second level with a lost page", second);

        Console.WriteLine("# settings");
        foreach (TextureImporter importer in AssetImporter.All.Values)
            Console.WriteLine(string.Join(" ", importer.textureType, importer.textureCompression,
                importer.mipmapEnabled, importer.wrapMode, importer.npotScale, importer.maxTextureSize,
                importer.Imports));
        Color d = LightmapSettings.lightmaps.Last().lightmapDir.Texel;
        Console.WriteLine(string.Join(" ", "direction", d.r, d.g, d.b, d.a));

        Console.WriteLine("# build");
        Scene scene = new Scene { Roots = new[] { new GameObject("other"), first } };
        Scene other = new Scene { Roots = new[] { new GameObject("other") } };
        LightmapShaders check = new LightmapShaders();
        check.OnProcessScene(scene, new BuildReport());
        SerializedObject.Stored["m_LightmapStripping"].intValue = 0;
        check.OnProcessScene(scene, null);
        check.OnProcessScene(other, new BuildReport());
        Console.WriteLine("then");
        check.OnProcessScene(scene, new BuildReport());
    }
}
