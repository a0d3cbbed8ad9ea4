// A lamp to drag in a baked scene. Beside this page lie node_modules with three and localprt, and SCENE.lprt with SCENE.glb.
// ?scene=NAME, and for pictures: size=WxH, frames=K gathers, exposure=EV, shadows=SIZE, tone=clamp|neutral|agx, view=final|indirect.
// How it went is in window.localprt, for tests.
import * as THREE from "three/webgpu";
import { DragControls } from "three/addons/controls/DragControls.js";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Localprt } from "localprt";

const MOST_LOSSES = 3;
const TONES = { clamp: THREE.LinearToneMapping, neutral: THREE.NeutralToneMapping, agx: THREE.AgXToneMapping };
const asked = Object.fromEntries(new URLSearchParams(location.search));
// Texels per side of the bounced light's shadow maps; those of three.js have half as many.
const shadowMapSize = Number(asked.shadows ?? 2048);
const message = document.getElementById("message");
let losses = 0;

// Bakes are of diffuse surfaces; a material with reflections works too, and adds them to direct light.
function diffuse({ name, color, map, emissive, emissiveMap, emissiveIntensity, side, alphaTest, vertexColors }) {
    return new THREE.MeshLambertMaterial({ name, color, map, emissive, emissiveMap, emissiveIntensity, side, alphaTest, vertexColors });
}

async function start() {
    const gpu = await Localprt.create();
    const canvas = document.body.insertBefore(document.createElement("canvas"), message);
    const renderer = new THREE.WebGPURenderer({ canvas, device: gpu.device, antialias: true });
    await renderer.init();
    // A device that is lost takes both with it: start again, on a canvas of its own.
    renderer.onDeviceLost = () => {};
    gpu.lost.then(async ({ reason, message: why }) => {
        if (reason === "destroyed") return;
        renderer.setAnimationLoop(null);
        canvas.remove();
        if (++losses > MOST_LOSSES) return failed(new Error(`the graphics device was lost again and again: ${why}`));
        window.localprt = { state: "loading", losses };
        await start().catch(failed);
    });

    const file = `${asked.scene ?? "cornell"}.lprt`;
    const [relit, gltf] = await Promise.all([
        gpu.load(file, { shadowMapSize }),
        new GLTFLoader().loadAsync(file.replace(/lprt$/, "glb")),
    ]);
    const scene = new THREE.Scene();
    scene.background = new THREE.Color(0, 0, 0);
    scene.add(gltf.scene);
    const replaced = new Map();
    scene.traverse((object) => {
        if (object.isMesh) {
            if (!replaced.has(object.material)) replaced.set(object.material, diffuse(object.material));
            object.material = replaced.get(object.material);
            object.castShadow = object.receiveShadow = true;
        }
    });
    const box = new THREE.Box3().setFromObject(gltf.scene);
    const extent = box.getSize(new THREE.Vector3()).length();
    let lamp = scene.getObjectByProperty("isPointLight", true);
    if (!lamp) {
        lamp = new THREE.PointLight(0xffffff, 2 * extent ** 2 / 100);
        box.getCenter(lamp.position);
        scene.add(lamp);
    }
    scene.attach(lamp);
    scene.traverse((light) => {
        if (!light.isLight) return;
        light.castShadow = true;
        light.shadow.mapSize.setScalar(shadowMapSize / 2);
        light.shadow.normalBias = 0.002 * extent;
        Object.assign(light.shadow.camera, { near: 0.005 * extent, far: 2 * extent });
        if (light.isDirectionalLight) {
            const half = 0.5 * extent;
            Object.assign(light.shadow.camera, { left: -half, right: half, bottom: -half, top: half, near: -extent });
        }
    });
    relit.applyTo(scene);

    let camera = gltf.cameras[0];
    if (!camera) {
        camera = new THREE.PerspectiveCamera(60);
        camera.position.copy(box.getCenter(new THREE.Vector3())).z = box.max.z;
        scene.add(camera);
    }
    scene.attach(camera);
    renderer.shadowMap.enabled = true;
    renderer.toneMapping = TONES[asked.tone ?? "neutral"];
    renderer.toneMappingExposure = 2 ** Number(asked.exposure ?? 0);
    function resize() {
        const [width, height] = (asked.size ?? `${innerWidth}x${innerHeight}`).split("x").map(Number);
        renderer.setPixelRatio(asked.size ? 1 : devicePixelRatio);
        renderer.setSize(width, height);
        camera.aspect = width / height;
        camera.updateProjectionMatrix();
    }
    resize();
    addEventListener("resize", resize);

    const frame = () => {
        relit.update(scene);
        renderer.render(scene, camera);
    };
    window.localprt = { state: "loading", losses, THREE, gpu, relit, renderer, scene, camera, lamp, frame };
    if (asked.frames) {
        // A picture: so many gathers from darkness.
        for (let gather = 0; gather < Number(asked.frames); gather += 1) relit.update(scene);
        if (asked.view === "indirect") showIndirect(scene, replaced);
        renderer.render(scene, camera);
        window.localprt.state = "done";
    } else {
        play(renderer, scene, camera, lamp, box, frame);
        window.localprt.state = "open";
    }
    message.textContent = "";
}

// What the viewer's view of this name shows: indirect light alone on surfaces of albedo 0.5.
function showIndirect(scene, materials) {
    scene.traverse((object) => object.isLight && (object.visible = false));
    for (const material of materials.values()) {
        material.map = material.emissiveMap = null;
        material.color.setRGB(0.5, 0.5, 0.5);
        material.emissive.setScalar(0);
        material.vertexColors = false;
        material.needsUpdate = true;
    }
}

function play(renderer, scene, camera, lamp, box, frame) {
    const handle = new THREE.Mesh(
        new THREE.SphereGeometry(0.01 * box.getSize(new THREE.Vector3()).length()),
        new THREE.MeshBasicMaterial({ color: lamp.color }),
    );
    handle.position.copy(lamp.position);
    scene.add(handle);
    // The controls turn the camera to their target at once.
    const ahead = camera.getWorldDirection(new THREE.Vector3());
    const orbit = new OrbitControls(camera, renderer.domElement);
    orbit.target.copy(camera.position).addScaledVector(ahead, box.getCenter(new THREE.Vector3()).sub(camera.position).dot(ahead));
    orbit.update();
    const drag = new DragControls([handle], camera, renderer.domElement);
    drag.addEventListener("dragstart", () => (orbit.enabled = false));
    drag.addEventListener("drag", () => lamp.position.copy(handle.position.clamp(box.min, box.max)));
    drag.addEventListener("dragend", () => (orbit.enabled = true));
    const sky = document.getElementById("sky");
    sky.oninput = () => scene.background.setRGB(0.4, 0.6, 1).multiplyScalar(Number(sky.value));
    window.localprt.handle = handle;
    window.localprt.frames = 0;
    renderer.setAnimationLoop(() => {
        frame();
        window.localprt.frames += 1;
    });
}

function failed(error) {
    message.textContent = error.message ?? error;
    window.localprt = { state: "failed", message: String(error.message ?? error), stack: error.stack };
}

window.localprt = { state: "loading" };
start().catch(failed);
