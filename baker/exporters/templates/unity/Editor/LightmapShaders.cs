// Menu Baker > Keep lightmap shaders in builds, and a warning in builds where they would be missing.
// With the setting "Automatic", Unity removes the shader variants with lightmaps from a build if no scene of it has
// lightmaps that Unity baked. Then scenes of baker have no light in the build, although they have it in the editor.
using UnityEditor;
using UnityEditor.Build;
using UnityEditor.Build.Reporting;
using UnityEngine;
using UnityEngine.SceneManagement;

namespace Baker
{
    public sealed class LightmapShaders : IProcessSceneWithReport
    {
        public const string Warning =
            "Baker: Unity may remove the shaders with lightmaps from builds. Choose Baker > Keep lightmap shaders in "
            + "builds, or set Project Settings > Graphics > Shader Stripping > Lightmap Modes to Custom.";

        private const string SettingsPath = "ProjectSettings/GraphicsSettings.asset";
        private const string Mode = "m_LightmapStripping";
        private const string KeepPlain = "m_LightmapKeepPlain";
        private const string KeepDirectional = "m_LightmapKeepDirCombined";
        private const int Custom = 1;

        public int callbackOrder
        {
            get { return 0; }
        }

        public static bool AreStripped()
        {
            SerializedObject settings = Settings();
            return settings.FindProperty(Mode).intValue != Custom || !settings.FindProperty(KeepPlain).boolValue;
        }

        // Changes a setting of the project, and therefore runs only when the user chooses it.
        [MenuItem("Baker/Keep lightmap shaders in builds")]
        public static void Keep()
        {
            SerializedObject settings = Settings();
            settings.FindProperty(Mode).intValue = Custom;
            settings.FindProperty(KeepPlain).boolValue = true;
            settings.FindProperty(KeepDirectional).boolValue = true;
            settings.ApplyModifiedProperties();
            AssetDatabase.SaveAssets();
            Debug.Log("Baker: Lightmap Modes is now Custom, with Baked Non-Directional and Baked Directional.");
        }

        // Unity calls it for each scene of a build, and with an empty report when play mode starts.
        public void OnProcessScene(Scene scene, BuildReport report)
        {
            if (report == null || !AreStripped()) return;
            foreach (GameObject root in scene.GetRootGameObjects())
            {
                if (root.GetComponentsInChildren<BakerLightmaps>(true).Length == 0) continue;
                Debug.LogWarning(Warning);
                return;
            }
        }

        private static SerializedObject Settings()
        {
            return new SerializedObject(AssetDatabase.LoadAllAssetsAtPath(SettingsPath)[0]);
        }
    }
}
