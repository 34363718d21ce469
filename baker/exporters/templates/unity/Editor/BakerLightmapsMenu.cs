// Menu Baker > Apply lightmaps: assigns the pages of a bake to the renderers of its scene.
// Select the imported scene.glb in the hierarchy before. Repeat it after every bake.
using System;
using System.Collections.Generic;
using System.IO;
using UnityEditor;
using UnityEngine;

namespace Baker
{
    public static class BakerLightmapsMenu
    {
        private const string DescriptionName = "lightmap.json";
        private const string Title = "Baker";

        [Serializable]
        private sealed class Page
        {
            public string file = "";
            public int width = 0;
            public int height = 0;
        }

        [Serializable]
        private sealed class BakedObject
        {
            public int node = 0;
            public string name = "";
            public int page = 0;
            public float[] scaleOffset = new float[0];
        }

        [Serializable]
        private sealed class Description
        {
            public Page[] pages = new Page[0];
            public BakedObject[] objects = new BakedObject[0];
        }

        [MenuItem("Baker/Apply lightmaps")]
        public static void ApplyToSelection()
        {
            GameObject selected = Selection.activeGameObject;
            GameObject root = selected == null ? null : PrefabUtility.GetNearestPrefabInstanceRoot(selected);
            string folder = root == null ? null : FolderOf(root);
            Description description = folder == null ? null : Read(folder);
            if (description == null)
            {
                EditorUtility.DisplayDialog(Title, "Select the imported scene.glb of a bake in the hierarchy.", "OK");
                return;
            }
            Texture2D[] pages = Array.ConvertAll(description.pages, page => Import(folder + "/" + page.file, page));
            Assign(root, description, pages);
            if (LightmapShaders.AreStripped()) Debug.LogWarning(LightmapShaders.Warning);
        }

        private static void Assign(GameObject root, Description description, Texture2D[] pages)
        {
            BakerLightmaps target = root.GetComponent<BakerLightmaps>();
            if (target == null) target = Undo.AddComponent<BakerLightmaps>(root);
            Undo.RecordObject(target, "Apply lightmaps");
            Dictionary<string, BakedObject> missing = new Dictionary<string, BakedObject>();
            foreach (BakedObject entry in description.objects) missing[entry.name] = entry;
            Dictionary<string, BakedObject> byName = new Dictionary<string, BakedObject>(missing);
            List<Renderer> renderers = new List<Renderer>();
            List<int> page = new List<int>();
            List<Vector4> scaleOffset = new List<Vector4>();
            foreach (Renderer renderer in root.GetComponentsInChildren<Renderer>(true))
            {
                BakedObject entry = Find(renderer.transform, root.transform, byName);
                if (entry == null) continue;
                float[] st = entry.scaleOffset;
                renderers.Add(renderer);
                page.Add(entry.page);
                scaleOffset.Add(new Vector4(st[0], st[1], st[2], st[3]));
                missing.Remove(entry.name);
            }
            target.pages = pages;
            target.renderers = renderers.ToArray();
            target.page = page.ToArray();
            target.scaleOffset = scaleOffset.ToArray();
            target.Apply();
            EditorUtility.SetDirty(target);
            int lights = DisableLights(root);
            int found = description.objects.Length - missing.Count;
            Debug.Log("Baker: " + found + " of " + description.objects.Length + " objects have their lightmap. Lights disabled: "
                + lights + ".");
            foreach (string name in missing.Keys) Debug.LogWarning("Baker: no renderer is named " + name + ".");
        }

        // The pages contain the light of all lights of scene.glb.
        private static int DisableLights(GameObject root)
        {
            int count = 0;
            foreach (Light light in root.GetComponentsInChildren<Light>(true))
            {
                if (!light.enabled) continue;
                Undo.RecordObject(light, "Apply lightmaps");
                light.enabled = false;
                count++;
            }
            return count;
        }

        // Import a page as Unity imports its own lightmaps: with the encoding of the platform, which is BC6H for
        // the lightmap encoding "High Quality" on desktops and consoles. Mip levels would mix charts.
        // Settings that the user has changed since then stay; only the size grows with the page.
        private static Texture2D Import(string path, Page page)
        {
            TextureImporter importer = AssetImporter.GetAtPath(path) as TextureImporter;
            if (importer == null)
            {
                Debug.LogError("Baker: there is no page " + path + ". Copy all files of the bake.");
                return null;
            }
            int size = Mathf.Max(32, Mathf.NextPowerOfTwo(Mathf.Max(page.width, page.height)));
            bool first = importer.textureType != TextureImporterType.Lightmap;
            if (first)
            {
                importer.textureType = TextureImporterType.Lightmap;
                importer.textureCompression = TextureImporterCompression.CompressedHQ;
                importer.mipmapEnabled = false;
                importer.wrapMode = TextureWrapMode.Clamp;
                importer.filterMode = FilterMode.Bilinear;
                importer.npotScale = TextureImporterNPOTScale.None;
            }
            if (first || importer.maxTextureSize < size)
            {
                importer.maxTextureSize = size;
                importer.SaveAndReimport();
            }
            return AssetDatabase.LoadAssetAtPath<Texture2D>(path);
        }

        // Node i is named ..._n<i>. Importers create a child for each primitive of a mesh: search its parents, too.
        private static BakedObject Find(Transform node, Transform root, Dictionary<string, BakedObject> byName)
        {
            for (; node != null; node = node == root ? null : node.parent)
            {
                BakedObject entry;
                if (byName.TryGetValue(node.name, out entry)) return entry;
            }
            return null;
        }

        // The folder of the asset from which the object was placed, also if it is part of another prefab.
        private static string FolderOf(GameObject root)
        {
            string path = AssetDatabase.GetAssetPath(PrefabUtility.GetCorrespondingObjectFromOriginalSource(root));
            return string.IsNullOrEmpty(path) ? null : Path.GetDirectoryName(path).Replace('\\', '/');
        }

        private static Description Read(string folder)
        {
            string path = Path.Combine(folder, DescriptionName);
            return File.Exists(path) ? JsonUtility.FromJson<Description>(File.ReadAllText(path)) : null;
        }
    }
}
