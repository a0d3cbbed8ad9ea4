// Baked global illumination that moves with the lights, for three.js. See README.md.
import init, * as wasm from "./wasm/localprt_wasm.js";
import { ExternalTexture, LinearFilter, HalfFloatType, NoColorSpace, Vector3 } from "three/webgpu";

const POINT = 0, SPOT = 1, DIRECTIONAL = 2;
// Numbers of a light and of a material, as the WebAssembly takes them.
const LIGHT = 14, MATERIAL = 4;

let ready;

/** A WebGPU device that three.js and the relighter share. */
export class Localprt {
    /** Asks the browser for a device. `wasm` is where the WebAssembly is, if not beside this file. */
    static async create({ wasm: address, powerPreference = "high-performance" } = {}) {
        if (!globalThis.navigator?.gpu) {
            throw new Error("this browser has no WebGPU here: it takes a recent browser, and a page from https or localhost");
        }
        // Compiled once, even if the first device is lost; a download that failed may be tried again.
        ready ??= init({ module_or_path: address ?? new URL("./wasm/localprt_wasm_bg.wasm", import.meta.url) }).catch((error) => {
            ready = undefined;
            throw error;
        });
        await ready;
        return new Localprt(await wasm.Device.request(powerPreference === "low-power"));
    }

    #device;
    #scenes = new Set();

    constructor(device) {
        this.#device = device;
        /** For `new WebGPURenderer({ device })`. */
        this.device = device.handle;
        /** Resolves with the browser's reason and message when the device is gone, and everything on it. */
        this.lost = this.device.lost;
    }

    /** What the browser calls the adapter; many say nothing. */
    get name() {
        return this.#device.name;
    }

    /**
     * A baked file with its scene, the .glb that the bake wrote beside it: addresses, or bytes. Prepares the scene on the page's
     * own thread, which takes a while for large ones.
     */
    async load(file, { scene, bounces = 1, shadowMapSize = 2048 } = {}) {
        const bytes = await fetched(file);
        if (scene === undefined) {
            if (typeof file !== "string" && !(file instanceof URL)) throw new Error("load: bytes do not say where their scene is; name it: { scene }");
            scene = new URL(wasm.scenePath(bytes), new URL(file, document.baseURI));
        }
        const sceneBytes = await fetched(scene);
        const name = sceneBytes === scene || scene instanceof ArrayBuffer ? "the scene" : String(scene);
        const ledger = new Ledger(this.device);
        try {
            const relight = ledger.during(() => new wasm.Relight(this.#device, bytes, name, sceneBytes, bounces, shadowMapSize));
            const relit = new RelitScene(relight, ledger, bounces, (gone) => this.#scenes.delete(gone));
            this.#scenes.add(relit);
            return relit;
        } catch (error) {
            ledger.destroy();
            throw error;
        }
    }

    /** Lets go of every scene and of the device. Dispose of renderers that use it first. */
    dispose() {
        for (const scene of [...this.#scenes]) scene.dispose();
        if (this.#device) {
            this.device.destroy();
            this.#device.free();
            this.#device = undefined;
        }
    }
}

/** A baked scene whose light follows that of three.js. */
class RelitScene {
    #relight;
    #ledger;
    #bounces;
    #forget;
    #names;
    #own = new Map();
    #sent = {};

    constructor(relight, ledger, bounces, forget) {
        this.#relight = relight;
        this.#ledger = ledger;
        this.#bounces = bounces;
        this.#forget = forget;
        this.#names = relight.materials;
        const texture = new ExternalTexture(relight.texture);
        // As it is: irradiance, row 0 at v = 0, read by the second set of texture coordinates.
        Object.assign(texture, {
            name: "localprt.irradiance", channel: 1, flipY: false, generateMipmaps: false, type: HalfFloatType,
            colorSpace: NoColorSpace, minFilter: LinearFilter, magFilter: LinearFilter,
        });
        /** Indirect irradiance, W m^-2: what `material.lightMap` takes. */
        this.lightMap = texture;
    }

    /** Lights every mesh below `root` that has the coordinates of the bake (TEXCOORD_1), and returns how many there were. */
    applyTo(root) {
        let found = 0;
        root.traverse((object) => {
            if (!object.isMesh || !object.geometry.attributes.uv1) return;
            found += 1;
            for (const material of materialsOf(object)) {
                material.lightMap = this.lightMap;
                material.lightMapIntensity = 1;
                material.needsUpdate = true;
                // Changes from here on go into the light; until then the bake's scene says what shines, textures included.
                if (!this.#own.has(material)) this.#own.set(material, emission(material));
            }
        });
        return found;
    }

    /**
     * Relights by what shines below `scene` now: point, spot and directional lights that are visible, emission of materials that
     * have changed since `applyTo`, and the color of `scene.background`, or `sky`. Once per frame, before `renderer.render`.
     */
    update(scene, { sky, lights } = {}) {
        if (!this.#relight) throw new Error("update: this scene was disposed of");
        scene.updateMatrixWorld();
        this.#send("setLights", lightRows(lights ?? visibleLights(scene)));
        this.#send("setMaterials", this.#materialRows());
        this.#send("setSky", skyRow(sky ?? scene.background));
        this.#ledger.during(() => this.#relight.frame());
    }

    #send(what, numbers) {
        const before = this.#sent[what];
        if (before?.length === numbers.length && before.every((number, at) => number === numbers[at])) return;
        this.#ledger.during(() => this.#relight[what](numbers));
        this.#sent[what] = numbers;
    }

    #materialRows() {
        const rows = new Float32Array(this.#names.length * MATERIAL);
        for (const [material, own] of this.#own) {
            const now = emission(material);
            if (now.every((band, at) => band === own[at])) continue;
            this.#names.forEach((name, at) => name === material.name && rows.set([1, ...now], at * MATERIAL));
        }
        return rows;
    }

    /** Gathers in each update, at least 1: more follow quick changes within one frame. */
    get bounces() {
        return this.#bounces;
    }

    set bounces(bounces) {
        this.#bounces = Math.max(1, Math.round(bounces));
        this.#relight.setBounces(this.#bounces);
    }

    /** Forgets all light, for cuts: the next update starts with a first bounce. */
    reset() {
        this.#relight.reset();
    }

    /** Gathers since the start or the last reset. */
    get gathers() {
        return this.#relight.gathers;
    }

    /** Device memory by purpose, and what the browser was asked for in all, bytes. */
    get memory() {
        const bytes = this.#relight?.memory ?? [];
        const byPurpose = Object.fromEntries((this.#relight?.memoryNames ?? []).map((name, at) => [name, bytes[at]]));
        return { byPurpose, webAssembly: wasm.memoryBytes(), ...this.#ledger.sums() };
    }

    /** Gives all device memory back at once, not when the browser collects garbage. Materials lose the light map. */
    dispose() {
        if (!this.#relight) return;
        for (const material of this.#own.keys()) {
            if (material.lightMap !== this.lightMap) continue;
            material.lightMap = null;
            material.needsUpdate = true;
        }
        this.lightMap.dispose();
        this.#relight.free();
        this.#relight = undefined;
        this.#own.clear();
        this.#ledger.destroy();
        this.#forget(this);
    }
}

/** Buffers and textures that a device made for one scene: wgpu leaves them to the garbage collector, which does not see their size. */
class Ledger {
    #device;
    #made = new Set();
    #gone = new FinalizationRegistry((reference) => this.#made.delete(reference));

    constructor(device) {
        this.#device = device;
    }

    during(work) {
        const device = this.#device;
        const note = (resource) => {
            const reference = new WeakRef(resource);
            this.#made.add(reference);
            this.#gone.register(resource, reference);
            return resource;
        };
        // The device's own again afterwards: nothing but this synchronous work is noted.
        device.createBuffer = (descriptor) => note(GPUDevice.prototype.createBuffer.call(device, descriptor));
        device.createTexture = (descriptor) => note(GPUDevice.prototype.createTexture.call(device, descriptor));
        try {
            return work();
        } finally {
            delete device.createBuffer;
            delete device.createTexture;
        }
    }

    #alive() {
        return [...this.#made].map((reference) => reference.deref()).filter(Boolean);
    }

    sums() {
        const alive = this.#alive();
        const buffers = alive.filter((resource) => resource instanceof GPUBuffer);
        return {
            buffers: buffers.length,
            bufferBytes: buffers.reduce((sum, buffer) => sum + buffer.size, 0),
            textures: alive.length - buffers.length,
        };
    }

    destroy() {
        for (const resource of this.#alive()) resource.destroy();
        this.#made.clear();
    }
}

async function fetched(source) {
    if (source instanceof Uint8Array) return source;
    if (source instanceof ArrayBuffer) return new Uint8Array(source);
    const response = await fetch(source);
    if (!response.ok) throw new Error(`${source}: ${response.status} ${response.statusText}`);
    return new Uint8Array(await response.arrayBuffer());
}

const materialsOf = (mesh) => (Array.isArray(mesh.material) ? mesh.material : [mesh.material]);

function emission(material) {
    const { emissive, emissiveIntensity = 1 } = material;
    return emissive ? emissive.toArray().map((band) => band * emissiveIntensity) : [0, 0, 0];
}

function visibleLights(scene) {
    const lights = [];
    scene.traverseVisible((object) => object.isLight && lights.push(object));
    return lights;
}

const at = new Vector3(), toward = new Vector3();

function lightRows(lights) {
    const known = lights.filter((light) => light.isPointLight || light.isSpotLight || light.isDirectionalLight);
    const rows = new Float32Array(known.length * LIGHT);
    known.forEach((light, index) => {
        const kind = light.isPointLight ? POINT : light.isSpotLight ? SPOT : DIRECTIONAL;
        at.setFromMatrixPosition(light.matrixWorld);
        toward.set(0, -1, 0);
        if (light.target) {
            // A target that is not part of the scene moves by itself.
            light.target.updateWorldMatrix(true, false);
            toward.setFromMatrixPosition(light.target.matrixWorld).sub(at);
            if (toward.lengthSq() === 0) toward.set(0, -1, 0);
            toward.normalize();
        }
        const outer = light.angle ?? 0, inner = outer * (1 - (light.penumbra ?? 0));
        rows.set([kind, ...at.toArray(), ...toward.toArray(), ...light.color.toArray(), light.intensity, light.distance ?? 0, inner, outer], index * LIGHT);
    });
    return rows;
}

function skyRow(sky) {
    const row = new Float32Array(9);
    // three.js shows a color as it is, whatever `backgroundIntensity` says.
    const { zenith, horizon, ground } = sky?.isColor ? { zenith: sky, horizon: sky, ground: sky } : sky ?? {};
    if (zenith) row.set([...zenith.toArray(), ...horizon.toArray(), ...ground.toArray()]);
    return row;
}
