// Stands in for the classes of Unity that the scripts of the export use, with the signatures of its scripting
// reference (2021.3). It behaves as the reference says as far as the tests need: adding a component enables it,
// importers count their imports, settings of the project are stored.
using System;
using System.Collections.Generic;
using System.Linq;

namespace UnityEngine
{
    public enum TextureFormat { RGBAHalf }
    public enum TextureWrapMode { Repeat, Clamp }
    public enum FilterMode { Point, Bilinear }
    [Flags] public enum HideFlags { None = 0, HideAndDontSave = 61 }
    public sealed class ExecuteAlways : Attribute { }
    public sealed class DisallowMultipleComponent : Attribute { }

    public class Object
    {
        public string name { get; set; }
        public HideFlags hideFlags { get; set; }
    }

    public struct Color
    {
        public float r, g, b, a;
        public Color(float r, float g, float b, float a) { this.r = r; this.g = g; this.b = b; this.a = a; }
    }

    public struct Vector4
    {
        public float x, y, z, w;
        public Vector4(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
    }

    public static class Mathf
    {
        public static int Max(int a, int b) { return Math.Max(a, b); }
        public static int NextPowerOfTwo(int value)
        {
            int power = 1;
            while (power < value) power *= 2;
            return power;
        }
    }

    public sealed class Texture2D : Object
    {
        public Color Texel;
        public Texture2D(int width, int height, TextureFormat textureFormat, bool mipChain, bool linear) { }
        public void SetPixel(int x, int y, Color color) { Texel = color; }
        public void Apply() { }
    }

    public class Component : Object
    {
        public GameObject gameObject;
        public Transform transform { get { return gameObject.transform; } }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour { }
    public sealed class Light : Behaviour { }

    public class Renderer : Component
    {
        public int lightmapIndex { get; set; }
        public Vector4 lightmapScaleOffset { get; set; }
    }

    public sealed class Transform : Object
    {
        public readonly List<Transform> Children = new List<Transform>();
        public readonly GameObject Owner;
        public Transform parent { get; private set; }
        public Transform(GameObject owner) { Owner = owner; }

        public void SetParent(Transform value)
        {
            parent = value;
            value.Children.Add(this);
        }
    }

    public sealed class GameObject : Object
    {
        private readonly List<Component> components = new List<Component>();
        public Transform transform { get; private set; }

        public GameObject(string name)
        {
            this.name = name;
            transform = new Transform(this) { name = name };
        }

        public T AddComponent<T>() where T : Component
        {
            T made = Activator.CreateInstance<T>();
            made.gameObject = this;
            made.name = name;
            components.Add(made);
            var enable = typeof(T).GetMethod(
                "OnEnable", System.Reflection.BindingFlags.Instance | System.Reflection.BindingFlags.NonPublic);
            if (enable != null) enable.Invoke(made, null);
            return made;
        }

        public T GetComponent<T>()
        {
            return components.OfType<T>().FirstOrDefault();
        }

        public T[] GetComponentsInChildren<T>(bool includeInactive)
        {
            return components.OfType<T>()
                .Concat(transform.Children.SelectMany(c => c.Owner.GetComponentsInChildren<T>(includeInactive)))
                .ToArray();
        }
    }

    public sealed class LightmapData
    {
        public Texture2D lightmapColor { get; set; }
        public Texture2D lightmapDir { get; set; }
    }

    public static class LightmapSettings
    {
        private static LightmapData[] stored = new LightmapData[0];

        public static LightmapData[] lightmaps
        {
            get { return (LightmapData[])stored.Clone(); }
            set { stored = value; }
        }
    }

    public static class Debug
    {
        public static void Log(object message) { Console.WriteLine("log: " + message); }
        public static void LogWarning(object message) { Console.WriteLine("warning: " + message); }
        public static void LogError(object message) { Console.WriteLine("error: " + message); }
    }

    public static class JsonUtility
    {
        public static T FromJson<T>(string json)
        {
            int at = 0;
            return (T)Json.Make(typeof(T), Json.Read(json, ref at));
        }
    }
}

namespace UnityEngine.SceneManagement
{
    public struct Scene
    {
        public GameObject[] Roots;
        public GameObject[] GetRootGameObjects() { return Roots; }
    }
}

namespace UnityEditor
{
    using UnityEngine;

    public enum TextureImporterType { Default, Lightmap = 6 }
    public enum TextureImporterCompression { Uncompressed, Compressed, CompressedHQ, CompressedLQ }
    public enum TextureImporterNPOTScale { None, ToNearest }

    public sealed class MenuItem : Attribute
    {
        public MenuItem(string itemName) { }
    }

    public static class Selection
    {
        public static GameObject activeGameObject { get; set; }
    }

    public static class EditorUtility
    {
        public static void SetDirty(Object target) { }
        public static bool DisplayDialog(string title, string message, string ok)
        {
            Console.WriteLine("dialog: " + message);
            return true;
        }
    }

    public static class Undo
    {
        public static void RecordObject(Object objectToUndo, string name) { }
        public static T AddComponent<T>(GameObject gameObject) where T : Component
        {
            return gameObject.AddComponent<T>();
        }
    }

    public static class PrefabUtility
    {
        public static GameObject GetNearestPrefabInstanceRoot(Object componentOrGameObject)
        {
            GameObject at = (GameObject)componentOrGameObject;
            while (at.transform.parent != null) at = at.transform.parent.Owner;
            return at;
        }

        public static T GetCorrespondingObjectFromOriginalSource<T>(T componentOrGameObject) where T : Object
        {
            return componentOrGameObject;
        }
    }

    public class AssetImporter : Object
    {
        public static readonly Dictionary<string, AssetImporter> All = new Dictionary<string, AssetImporter>();
        public int Imports;
        public static AssetImporter GetAtPath(string path) { return All.ContainsKey(path) ? All[path] : null; }
        public void SaveAndReimport() { Imports++; }
    }

    public sealed class TextureImporter : AssetImporter
    {
        public TextureImporterType textureType { get; set; }
        public TextureImporterCompression textureCompression { get; set; }
        public TextureImporterNPOTScale npotScale { get; set; }
        public TextureWrapMode wrapMode { get; set; }
        public FilterMode filterMode { get; set; }
        public bool mipmapEnabled { get; set; }
        public int maxTextureSize { get; set; }

        public TextureImporter()
        {
            textureCompression = TextureImporterCompression.Compressed;
            npotScale = TextureImporterNPOTScale.ToNearest;
            mipmapEnabled = true;
            maxTextureSize = 32;
        }
    }

    public static class AssetDatabase
    {
        public static readonly Dictionary<string, Object> Assets = new Dictionary<string, Object>();
        public static readonly Dictionary<Object, string> Paths = new Dictionary<Object, string>();
        public static T LoadAssetAtPath<T>(string assetPath) where T : Object { return (T)Assets[assetPath]; }
        public static Object[] LoadAllAssetsAtPath(string assetPath) { return new[] { Assets[assetPath] }; }
        public static string GetAssetPath(Object asset) { return Paths.ContainsKey(asset) ? Paths[asset] : ""; }
        public static void SaveAssets() { }
    }

    public sealed class SerializedProperty
    {
        public int intValue { get; set; }
        public bool boolValue { get; set; }
    }

    public sealed class SerializedObject
    {
        public static readonly Dictionary<string, SerializedProperty> Stored =
            new Dictionary<string, SerializedProperty>();

        public SerializedObject(Object obj) { }
        public SerializedProperty FindProperty(string propertyPath) { return Stored[propertyPath]; }
        public bool ApplyModifiedProperties() { return true; }
    }
}

namespace UnityEditor.Build.Reporting
{
    public sealed class BuildReport { }
}

namespace UnityEditor.Build
{
    public interface IProcessSceneWithReport
    {
        int callbackOrder { get; }
        void OnProcessScene(UnityEngine.SceneManagement.Scene scene, Reporting.BuildReport report);
    }
}

// Reads JSON into the public fields of a class, as JsonUtility does.
internal static class Json
{
    public static object Read(string text, ref int at)
    {
        Skip(text, ref at);
        char first = text[at];
        if (first == '"') return Word(text, ref at);
        if (first != '{' && first != '[') return Value(text, ref at);
        var members = new Dictionary<string, object>();
        var items = new List<object>();
        at++;
        for (Skip(text, ref at); text[at] != '}' && text[at] != ']'; Skip(text, ref at))
        {
            string key = first == '{' ? Word(text, ref at) : null;
            Skip(text, ref at);
            if (key == null) items.Add(Read(text, ref at));
            else members[key] = Read(text, ref at);
        }
        at++;
        return first == '{' ? (object)members : items;
    }

    public static object Make(Type type, object value)
    {
        if (type.IsArray)
        {
            var items = (List<object>)value;
            Array made = Array.CreateInstance(type.GetElementType(), items.Count);
            for (int i = 0; i < items.Count; i++) made.SetValue(Make(type.GetElementType(), items[i]), i);
            return made;
        }
        if (!(value is Dictionary<string, object>))
            return Convert.ChangeType(value, type, System.Globalization.CultureInfo.InvariantCulture);
        object result = Activator.CreateInstance(type, true);
        foreach (var field in type.GetFields())
        {
            object member;
            if (((Dictionary<string, object>)value).TryGetValue(field.Name, out member))
                field.SetValue(result, Make(field.FieldType, member));
        }
        return result;
    }

    private static void Skip(string text, ref int at)
    {
        while (" \n,:".IndexOf(text[at]) >= 0) at++;
    }

    private static string Word(string text, ref int at)
    {
        int start = ++at;
        while (text[at] != '"') at++;
        return text.Substring(start, at++ - start);
    }

    private static string Value(string text, ref int at)
    {
        int start = at;
        while (",]} \n".IndexOf(text[at]) < 0) at++;
        return text.Substring(start, at - start);
    }
}
