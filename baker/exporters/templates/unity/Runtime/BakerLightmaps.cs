// Stores the lightmaps of a baked scene, and passes them to Unity whenever it is enabled.
// Unity does not keep lightmaps that a script has set when a scene is loaded again.
using System.Collections.Generic;
using UnityEngine;

namespace Baker
{
    [ExecuteAlways]
    [DisallowMultipleComponent]
    public sealed class BakerLightmaps : MonoBehaviour
    {
        // Pages contain irradiance / pi, because Unity multiplies a lightmap only by the albedo.
        public Texture2D[] pages = new Texture2D[0];
        public Renderer[] renderers = new Renderer[0];
        public int[] page = new int[0];
        public Vector4[] scaleOffset = new Vector4[0];

        private static Texture2D noDirection;

        private void OnEnable()
        {
            Apply();
        }

        // Lightmaps of other scenes and of Unity's own bake keep their numbers. Pages are added only once.
        public void Apply()
        {
            List<LightmapData> lightmaps = new List<LightmapData>(LightmapSettings.lightmaps);
            int[] number = new int[pages.Length];
            for (int i = 0; i < pages.Length; i++)
            {
                Texture2D image = pages[i];
                number[i] = image == null ? -1 : lightmaps.FindIndex(data => data.lightmapColor == image);
                if (image == null || number[i] >= 0) continue;
                number[i] = lightmaps.Count;
                lightmaps.Add(new LightmapData { lightmapColor = image, lightmapDir = NoDirection() });
            }
            LightmapSettings.lightmaps = lightmaps.ToArray();
            for (int i = 0; i < renderers.Length; i++)
            {
                if (renderers[i] == null) continue;
                renderers[i].lightmapIndex = number[page[i]];
                renderers[i].lightmapScaleOffset = scaleOffset[i];
            }
        }

        // In scenes with directional lightmaps, Unity multiplies by (dot(normal, d.xyz - 0.5) + 0.5) / d.w, where d
        // is the texel of lightmapDir. Of this d the factor is 1. Therefore the mode of the scene can stay.
        private static Texture2D NoDirection()
        {
            if (noDirection == null)
            {
                noDirection = new Texture2D(1, 1, TextureFormat.RGBAHalf, false, true);
                noDirection.hideFlags = HideFlags.HideAndDontSave;
                noDirection.SetPixel(0, 0, new Color(0.5f, 0.5f, 0.5f, 0.5f));
                noDirection.Apply();
            }
            return noDirection;
        }
    }
}
