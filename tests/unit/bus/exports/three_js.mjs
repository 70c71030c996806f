// Opens a .glb with three.js and says where each node is in the world at some times. Usage: three_js.mjs FILE TIME...
import fs from 'fs';
import { pathToFileURL } from 'url';
const folder = process.env.ELYS_NODE_MODULES + '/three/';
const THREE = await import(pathToFileURL(folder + 'build/three.module.js'));
const { GLTFLoader } = await import(pathToFileURL(folder + 'examples/jsm/loaders/GLTFLoader.js'));
globalThis.self = globalThis;
// Pixels are of no interest here, and there is no browser to decode them.
THREE.ImageBitmapLoader.prototype.load = function (url, done) { done({ width: 1, height: 1 }); };
THREE.TextureLoader.prototype.load = function (url, done) { const made = new THREE.Texture(); done(made); return made; };
const bytes = fs.readFileSync(process.argv[2]);
const data = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const gltf = await new Promise((done, failed) => new GLTFLoader().parse(data, '', done, failed));
const names = gltf.parser.json.nodes.map((node) => node.name);
const mixer = new THREE.AnimationMixer(gltf.scene);
for (const clip of gltf.animations) mixer.clipAction(clip).play();
const result = { names, clips: gltf.animations.map((clip) => clip.duration), moments: [] };
for (const time of process.argv.slice(3).map(Number)) {
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  const moment = {};
  gltf.scene.traverse((object) => {
    const reference = gltf.parser.associations.get(object);
    if (reference === undefined || reference.nodes === undefined) return;
    moment[names[reference.nodes]] = {
      matrix: Array.from(object.matrixWorld.elements),
      mesh: object.isMesh ? object.geometry.attributes.position.count : 0,
      color: object.isMesh ? object.material.color.toArray() : null,
      textured: object.isMesh ? object.material.map !== null : false,
      weights: object.morphTargetInfluences ? Array.from(object.morphTargetInfluences) : null,
      light: object.children.some((child) => child.isLight),
    };
  });
  result.moments.push(moment);
}
console.log(JSON.stringify(result));
process.exit(0);
