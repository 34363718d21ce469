// Stores the lightmaps of a baked scene, and passes them to Unity whenever it is enabled.
// Unity does not keep lightmaps that a script has set when a scene is loaded again.
using System.Collections.Generic;
using UnityEngine;

[ExecuteAlways]
[DisallowMultipleComponent]
public sealed class BakerLightmaps : MonoBehaviour
{
    // Pages contain irradiance / pi, because Unity multiplies a lightmap only by the albedo.
    public Texture2D[] pages = new Texture2D[0];
    public Renderer[] renderers = new Renderer[0];
    public int[] page = new int[0];
    public Vector4[] scaleOffset = new Vector4[0];

    private void OnEnable()
    {
        Apply();
    }

    public void Apply()
    {
        LightmapSettings.lightmapsMode = LightmapsMode.NonDirectional;
        List<LightmapData> lightmaps = new List<LightmapData>(LightmapSettings.lightmaps);
        int[] number = new int[pages.Length];
        for (int i = 0; i < pages.Length; i++)
        {
            number[i] = lightmaps.FindIndex(data => data.lightmapColor == pages[i]);
            if (number[i] < 0)
            {
                number[i] = lightmaps.Count;
                lightmaps.Add(new LightmapData { lightmapColor = pages[i] });
            }
        }
        LightmapSettings.lightmaps = lightmaps.ToArray();
        for (int i = 0; i < renderers.Length; i++)
        {
            if (renderers[i] == null) continue;
            renderers[i].lightmapIndex = number[page[i]];
            renderers[i].lightmapScaleOffset = scaleOffset[i];
        }
    }
}
