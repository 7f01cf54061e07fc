// Packs a GLB of one mesh and one texture: node pack.mjs IN.glb PIXELS OUT. PIXELS is the texture's RGBA. Writes OUT/edgebreaker.glb and OUT/sequential.glb (Draco), and
// OUT/etc1s.glb, OUT/uastc.glb and OUT/zstd.glb (KTX2) with the pixels that Binomial's transcoder makes of them in OUT/*.rgba.
import { NodeIO, ImageUtils } from "@gltf-transform/core";
import { KHRDracoMeshCompression, KHRTextureBasisu } from "@gltf-transform/extensions";
import { draco } from "@gltf-transform/functions";
import draco3d from "draco3dgltf";
import { encodeToKTX2 } from "ktx2-encoder";
import fs from "fs";
import { createRequire } from "module";

const [input, pixels, out] = process.argv.slice(2);
const log = console.log;
console.log = () => {};
const io = new NodeIO().registerExtensions([KHRDracoMeshCompression, KHRTextureBasisu]).registerDependencies({
  "draco3d.encoder": await draco3d.createEncoderModule(),
  "draco3d.decoder": await draco3d.createDecoderModule(),
});
for (const method of ["edgebreaker", "sequential"]) {
  const document = await io.read(input);
  await document.transform(draco({ method, quantizePosition: 14, quantizeNormal: 10, quantizeTexcoord: 12, quantizeGeneric: 12 }));
  await io.write(`${out}/${method}.glb`, document);
}
// The transcoder's script is CommonJS in a package of ECMAScript modules.
const libs = "node_modules/three/examples/jsm/libs/basis/basis_transcoder";
fs.copyFileSync(libs + ".js", "basis_transcoder.cjs");
const module = createRequire(import.meta.url)("./basis_transcoder.cjs");
const basis = await module({ wasmBinary: fs.readFileSync(libs + ".wasm") });
basis.initializeBasis();
for (const [name, options] of Object.entries({
  etc1s: { isUASTC: false, qualityLevel: 255 },
  uastc: { isUASTC: true, needSupercompression: false },
  zstd: { isUASTC: true, needSupercompression: true },
})) {
  const document = await io.read(input);
  const texture = document.getRoot().listTextures()[0];
  const [width, height] = texture.getSize();
  const data = new Uint8Array(fs.readFileSync(pixels));
  const imageDecoder = async () => ({ width, height, data });
  const ktx2 = await encodeToKTX2(new Uint8Array(1), { ...options, generateMipmap: true, isSetKTX2SRGBTransferFunc: true, imageDecoder });
  const file = new basis.KTX2File(ktx2);
  if (!file.startTranscoding()) throw new Error(name);
  const rgba = new Uint8Array(file.getImageTranscodedSizeInBytes(0, 0, 0, 13));
  if (!file.transcodeImage(rgba, 0, 0, 0, 13, 0, -1, -1)) throw new Error(name);
  fs.writeFileSync(`${out}/${name}.rgba`, rgba);
  texture.setImage(ktx2).setMimeType("image/ktx2");
  document.createExtension(KHRTextureBasisu).setRequired(true);
  await io.write(`${out}/${name}.glb`, document);
}
log("packed");
