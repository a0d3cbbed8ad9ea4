// What a page in TypeScript writes; scripts/three_test.sh has the compiler check it against the package's types.
import { Localprt, type RelitScene } from "localprt";
import { Color, PerspectiveCamera, Scene, WebGPURenderer } from "three/webgpu";

export async function show(canvas: HTMLCanvasElement): Promise<() => void> {
    const gpu: Localprt = await Localprt.create({ powerPreference: "low-power" });
    const renderer = new WebGPURenderer({ canvas, device: gpu.device });
    const scene = new Scene();
    const relit: RelitScene = await gpu.load(new URL("hall.lprt", document.baseURI), { scene: "hall.glb", bounces: 2 });
    const n_meshes: number = relit.applyTo(scene);
    relit.update(scene, { sky: { zenith: new Color(0, 0, 1), horizon: new Color(1, 1, 1), ground: new Color(0, 0, 0) } });
    renderer.render(scene, new PerspectiveCamera());
    const { reason } = await gpu.lost;
    console.log(n_meshes, relit.memory.byPurpose["irradiance map"], reason);
    // @ts-expect-error Scenes come from `load`.
    gpu.load(1);
    return () => relit.dispose();
}
