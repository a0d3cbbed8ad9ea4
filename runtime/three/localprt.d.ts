import type { Color, ExternalTexture, Light, Object3D, Scene } from "three/webgpu";

/** A WebGPU device that three.js and the relighter share. */
export class Localprt {
    private constructor();
    /**
     * Asks the browser for a device.
     * @throws Where the browser has no WebGPU, or gives this page none.
     */
    static create(options?: LocalprtOptions): Promise<Localprt>;
    /** For `new WebGPURenderer({ device })`. */
    readonly device: GPUDevice;
    /** Resolves when the device is gone, and everything on it: make another `Localprt` and another renderer then. */
    readonly lost: Promise<GPUDeviceLostInfo>;
    /** What the browser calls the adapter; many say nothing. */
    readonly name: string;
    /**
     * A baked file with its scene: addresses, or bytes. Prepares the scene on the page's own thread.
     * @throws Where either is broken, they do not belong together, or the device is too small.
     */
    load(file: Source, options?: LoadOptions): Promise<RelitScene>;
    /** Lets go of every scene and of the device. Dispose of renderers that use it first. */
    dispose(): void;
}

export interface LocalprtOptions {
    /** Where the WebAssembly is, if not in `wasm/` beside `localprt.js`. */
    wasm?: string | URL;
    /** Of two adapters, which; the fast one by default. */
    powerPreference?: "low-power" | "high-performance";
}

/** An address, or bytes that are there already. */
export type Source = string | URL | ArrayBuffer | Uint8Array;

export interface LoadOptions {
    /** The .glb that the bake wrote beside the file; by default where the file says that it is. */
    scene?: Source;
    /** Gathers in each update; 1 by default. */
    bounces?: number;
    /** Texels per side of the shadow maps by which the bounced light is shadowed; 2048 by default. */
    shadowMapSize?: number;
}

/** A baked scene whose light follows that of three.js. */
export interface RelitScene {
    /** Indirect irradiance, W m^-2, for `material.lightMap`; read by the attribute `uv1`. */
    readonly lightMap: ExternalTexture;
    /** Lights every mesh below `root` that has the attribute `uv1`, and returns how many there were. */
    applyTo(root: Object3D): number;
    /**
     * Relights by what shines below `scene` now; once per frame, before `renderer.render`.
     * @throws After `dispose`, and for numbers that are not finite.
     */
    update(scene: Scene, options?: UpdateOptions): void;
    /** Gathers in each update, at least 1. */
    bounces: number;
    /** Forgets all light: the next update starts with a first bounce. */
    reset(): void;
    /** Gathers since the start or the last reset. */
    readonly gathers: number;
    /** Memory in use. */
    readonly memory: RelitMemory;
    /** Gives all device memory back. Materials lose the light map. */
    dispose(): void;
}

export interface UpdateOptions {
    /** Radiance of the sky; that of `scene.background`, if it is a color, by default. */
    sky?: Color | { zenith: Color; horizon: Color; ground: Color };
    /** Lights to take instead of all that are visible. */
    lights?: readonly Light[];
}

export interface RelitMemory {
    /** Device memory by purpose, bytes. */
    byPurpose: Record<string, number>;
    /** The largest that the WebAssembly's memory has been, bytes. */
    webAssembly: number;
    /** Buffers that are alive. */
    buffers: number;
    /** Their bytes. */
    bufferBytes: number;
    /** Textures that are alive. */
    textures: number;
}
