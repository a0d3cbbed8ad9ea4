// Makes the files in this folder whose names end in .bin, with the reference encoder:
//   npm install meshoptimizer@1.3.0 && node make.mjs
// scenes/src/gltf_import/meshopt/tests.rs says what each decodes to, by the same formulas.
import { MeshoptEncoder as encoder } from 'meshoptimizer';
import { writeFileSync } from 'fs';

await encoder.ready;
const write = (name, bytes) => writeFileSync(new URL(`${name}.bin`, import.meta.url), bytes);
const bytesOf = (array) => new Uint8Array(array.buffer);

// Four words and two floats an element, in two blocks of which one ends within a group.
const count = 300;
const mixed = new DataView(new ArrayBuffer(16 * count));
for (let i = 0; i < count; i++) {
    for (let k = 0; k < 4; k++) mixed.setUint16(16 * i + 2 * k, (i * i * (k + 1) + 7 * k) & 0xffff, true);
    for (let k = 0; k < 2; k++) mixed.setFloat32(16 * i + 8 + 4 * k, 0.25 * i + k, true);
}
write('attributes-v0', encoder.encodeVertexBufferLevel(bytesOf(mixed), count, 16, 0, 0));
write('attributes-v1-level0', encoder.encodeVertexBufferLevel(bytesOf(mixed), count, 16, 0, 1));
write('attributes-v1-level3', encoder.encodeVertexBufferLevel(bytesOf(mixed), count, 16, 3, 1));
// Elements so large that a block has 32 of them.
const wide = new Uint8Array(256 * 70).map((_, at) => (at % 256 < 8 ? (at >> 8) * (at % 256) : at % 256));
write('attributes-wide', encoder.encodeVertexBufferLevel(wide, 70, 256, 3, 1));
// A constant byte and three of noise.
const noise = new Uint8Array(4 * 37).fill(7);
let state = 1;
for (let i = 0; i < 37; i++) {
    for (let k = 1; k < 4; k++) {
        state = (Math.imul(state, 1103515245) + 12345) >>> 0;
        noise[4 * i + k] = state >>> 16;
    }
}
write('attributes-noise', encoder.encodeVertexBufferLevel(noise, 37, 4, 3, 1));

// A strip of squares, and triangles that share little.
const triangles = [];
for (let y = 0; y < 5; y++) {
    for (let x = 0; x < 6; x++) triangles.push(...[0, 1, 7, 1, 8, 7].map((corner) => 7 * y + x + corner));
}
for (let y = 4; y >= 0; y -= 2) {
    for (let x = 5; x >= 0; x -= 3) triangles.push(...[0, 3, 9, 9, 3].map((corner) => 1000 + 350 * y + x + corner), 40);
}
write('triangles', encoder.encodeIndexBuffer(bytesOf(new Uint32Array(triangles)), triangles.length, 4));
write('indices', encoder.encodeIndexSequence(bytesOf(new Uint32Array(triangles)), triangles.length, 4));

// Directions over the sphere, turns about them, floats of many sizes, colors.
const n = 50;
const dirs = Array.from({ length: n }, (_, i) => {
    const z = 1 - (2 * i + 1) / n;
    const [radius, angle] = [Math.sqrt(1 - z * z), 2.399963 * i];
    return [radius * Math.cos(angle), radius * Math.sin(angle), z];
});
const vectors = new Float32Array(dirs.flatMap((dir, i) => [...dir, i % 2 ? 1 : -1]));
write('octahedral-8', encoder.encodeVertexBuffer(encoder.encodeFilterOct(vectors, n, 4, 7), n, 4));
write('octahedral-16', encoder.encodeVertexBuffer(encoder.encodeFilterOct(vectors, n, 8, 12), n, 8));
const turns = new Float32Array(dirs.flatMap((dir, i) => [...dir.map((axis) => axis * Math.sin(0.1 * i)), Math.cos(0.1 * i)]));
write('quaternion', encoder.encodeVertexBuffer(encoder.encodeFilterQuat(turns, n, 8, 14), n, 8));
const floats = new Float32Array(3 * n).map((_, i) => (i - 70) * 0.37 * 2 ** ((i % 40) - 20));
write('exponential', encoder.encodeVertexBuffer(encoder.encodeFilterExp(floats, n, 12, 15), n, 12));
const colors = new Float32Array(4 * n).map((_, i) => ((i * 37) % 101) / 100);
write('color-8', encoder.encodeVertexBuffer(encoder.encodeFilterColor(colors, n, 4, 8), n, 4));
write('color-16', encoder.encodeVertexBuffer(encoder.encodeFilterColor(colors, n, 8, 12), n, 8));
