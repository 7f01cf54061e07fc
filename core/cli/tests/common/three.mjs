// Loads a GLB into three.js and prints where its nodes are at some times: node three.mjs FILE.glb TIMES.json. One list of places a time, by the
// number of the node in the file.
import fs from "fs";
import { AnimationMixer, Texture, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

globalThis.self = globalThis;
const [file, times] = process.argv.slice(2);
const bytes = fs.readFileSync(file);
const loader = new GLTFLoader();
// Node has no decoder of images.
loader.register(() => ({ name: "no_images", loadTexture: async () => new Texture() }));
const gltf = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), "");
const nodes = [];
gltf.scene.traverse((object) => {
  const node = gltf.parser.associations.get(object)?.nodes;
  if (node !== undefined) nodes[node] ??= object;
});
const mixer = new AnimationMixer(gltf.scene);
mixer.clipAction(gltf.animations[0]).play();
const place = new Vector3();
const out = JSON.parse(fs.readFileSync(times, "utf8")).map((time) => {
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  return Array.from(nodes, (node) => (node ? place.setFromMatrixPosition(node.matrixWorld).toArray() : [0, 0, 0]));
});
console.log(JSON.stringify(out));
