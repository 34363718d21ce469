// Imports the pages of a bake as lightmaps and assigns them to the renderers of its scene.
// Menu: Baker > Apply lightmaps, with the imported scene.glb selected in the hierarchy.
using System;
using System.Collections.Generic;
using System.IO;
using UnityEditor;
using UnityEngine;

public sealed class BakerLightmapImporter : AssetPostprocessor
{
    private const string DescriptionName = "lightmap.json";

    [Serializable]
    private sealed class Page
    {
        public string file;
        public int width;
        public int height;
    }

    [Serializable]
    private sealed class BakedObject
    {
        public int node;
        public string name;
        public int page;
        public float[] scaleOffset;
    }

    [Serializable]
    private sealed class Description
    {
        public Page[] pages;
        public BakedObject[] objects;
    }

    // Pages are linear HDR images: disable sRGB decoding, resizing, and mip levels, which would mix charts.
    private void OnPreprocessTexture()
    {
        string folder = Path.GetDirectoryName(assetPath);
        Description description = Read(folder);
        if (description == null) return;
        Page page = Array.Find(description.pages, p => p.file == Path.GetFileName(assetPath));
        if (page == null) return;
        TextureImporter importer = (TextureImporter)assetImporter;
        importer.textureType = TextureImporterType.Lightmap;
        importer.sRGBTexture = false;
        importer.mipmapEnabled = false;
        importer.wrapMode = TextureWrapMode.Clamp;
        importer.filterMode = FilterMode.Bilinear;
        importer.npotScale = TextureImporterNPOTScale.None;
        importer.maxTextureSize = Mathf.Max(32, Mathf.NextPowerOfTwo(Mathf.Max(page.width, page.height)));
        // By default, Unity encodes lightmaps as BC6H or half on platforms with HDR, and elsewhere as RGBM (0
        // to 34.49 in linear colour space). Uncompressed keeps the values of the bake.
        importer.textureCompression = TextureImporterCompression.Uncompressed;
    }

    [MenuItem("Baker/Apply lightmaps")]
    private static void ApplyToSelection()
    {
        GameObject root = Selection.activeGameObject;
        string folder = root == null ? null : FolderOf(root);
        Description description = folder == null ? null : Read(folder);
        if (description == null)
        {
            EditorUtility.DisplayDialog("Baker", "Select the imported scene.glb of a bake in the hierarchy.", "OK");
            return;
        }
        BakerLightmaps target = root.GetComponent<BakerLightmaps>();
        if (target == null) target = root.AddComponent<BakerLightmaps>();
        target.pages = Array.ConvertAll(
            description.pages, page => AssetDatabase.LoadAssetAtPath<Texture2D>(folder + "/" + page.file));
        Dictionary<string, BakedObject> byName = new Dictionary<string, BakedObject>();
        foreach (BakedObject entry in description.objects) byName[entry.name] = entry;
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
            GameObjectUtility.SetStaticEditorFlags(
                renderer.gameObject,
                GameObjectUtility.GetStaticEditorFlags(renderer.gameObject) | StaticEditorFlags.ContributeGI);
            MeshRenderer mesh = renderer as MeshRenderer;
            if (mesh != null) mesh.receiveGI = ReceiveGI.Lightmaps;
        }
        target.renderers = renderers.ToArray();
        target.page = page.ToArray();
        target.scaleOffset = scaleOffset.ToArray();
        target.Apply();
        EditorUtility.SetDirty(target);
        Debug.Log("Baker: " + renderers.Count + " of " + description.objects.Length + " objects have their lightmap.");
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

    private static string FolderOf(GameObject root)
    {
        string path = PrefabUtility.GetPrefabAssetPathOfNearestInstanceRoot(root);
        return string.IsNullOrEmpty(path) ? null : Path.GetDirectoryName(path).Replace('\\', '/');
    }

    private static Description Read(string folder)
    {
        string path = Path.Combine(folder, DescriptionName);
        return File.Exists(path) ? JsonUtility.FromJson<Description>(File.ReadAllText(path)) : null;
    }
}
