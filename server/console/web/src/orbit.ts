// A camera that orbits around a box in space, moved by pointer, touch and keys.
import type { JSX, RefObject } from 'preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import { MathUtils, Matrix4, MOUSE, PerspectiveCamera, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

// The ends of the box: x, y, z, with z up, in metres.
export interface Box {
  least: number[];
  most: number[];
}

// Right and down from the corner of the picture, in pixels; null behind the camera.
export type Project = (x: number, y: number, z: number) => [number, number] | null;

export interface Orbit {
  width: number; // of the picture, in pixels
  height: number;
  project: Project;
  onKey: (event: JSX.TargetedKeyboardEvent<HTMLElement>) => void;
  look: (from: Direction) => void;
}

// From where the camera looks at the box.
export type Direction = 'corner' | 'above' | 'side';
const kDirections: Record<Direction, [number, number, number]> = {
  corner: [0.6, -1, 0.7],
  above: [0, -1e-4, 1],
  side: [0, -1, 0],
};

const kFieldOfView = 35; // degrees, vertical
const kTurn = MathUtils.degToRad(10); // for each key
const kZoom = 0.85;
const kSteps = 4; // until the box fills the picture
const kFilled = 0.86; // part of the picture that the box takes

function cornersOf({ least, most }: Box): Vector3[] {
  const ends = [least, most];
  return [0, 1, 2, 3, 4, 5, 6, 7].map(
    (i) => new Vector3(ends[i & 1][0], ends[(i >> 1) & 1][1], ends[i >> 2][2]),
  );
}

// The larger distance from the middle of the picture, of which 1 is the edge.
const extent = (place: Vector3) => Math.max(Math.abs(place.x), Math.abs(place.y));

function placeCamera(camera: PerspectiveCamera, controls: OrbitControls, box: Box, at: Direction) {
  const least = new Vector3().fromArray(box.least);
  const most = new Vector3().fromArray(box.most);
  const radius = Math.max(1e-3, most.distanceTo(least) / 2);
  const vertical = MathUtils.degToRad(kFieldOfView) / 2;
  const narrow = Math.min(vertical, Math.atan(Math.tan(vertical) * camera.aspect));
  const distance = radius / Math.sin(narrow);
  controls.target.copy(least).add(most).multiplyScalar(0.5);
  camera.position
    .fromArray(kDirections[at])
    .normalize()
    .multiplyScalar(distance)
    .add(controls.target);
  camera.near = distance / 1000;
  camera.far = 100 * distance;
  camera.updateProjectionMatrix();
  controls.update();
  // The sphere around the box is in the picture; closer, until a corner is at its
  // edge.
  for (let i = 0; i < kSteps; ++i) {
    camera.updateMatrixWorld();
    const size = Math.max(...cornersOf(box).map((corner) => extent(corner.project(camera))));
    camera.position
      .sub(controls.target)
      .multiplyScalar(size / kFilled)
      .add(controls.target);
    controls.update();
  }
}

function projection(camera: PerspectiveCamera, width: number, height: number): Project {
  const view = new Matrix4().copy(camera.matrixWorld).invert();
  const m = new Matrix4().multiplyMatrices(camera.projectionMatrix, view).elements;
  return (x, y, z) => {
    const depth = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (depth < camera.near) return null;
    const right = (m[0] * x + m[4] * y + m[8] * z + m[12]) / depth;
    const up = (m[1] * x + m[5] * y + m[9] * z + m[13]) / depth;
    return [((1 + right) * width) / 2, ((1 - up) * height) / 2];
  };
}

// Orbits around `box` in the element, which can take the focus. The wheel zooms
// only while it has the focus, so that it scrolls the page otherwise.
export function useOrbit(element: RefObject<HTMLElement>, box: Box): Orbit {
  const [camera] = useState(() => {
    const made = new PerspectiveCamera(kFieldOfView);
    made.up.set(0, 0, 1);
    return made;
  });
  const controls = useRef<OrbitControls | null>(null);
  const moved = useRef(false); // by the reader
  const [size, setSize] = useState<[number, number]>([0, 0]);
  const [project, setProject] = useState<Project>(() => () => null);
  const key = [...box.least, ...box.most].join();
  const look = (from: Direction) => {
    if (controls.current) placeCamera(camera, controls.current, box, from);
  };

  useLayoutEffect(() => {
    const target = element.current!;
    const made = new OrbitControls(camera, target);
    made.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    made.enableZoom = false;
    // A finger that moves up or down scrolls the page.
    target.style.touchAction = 'pan-y';
    controls.current = made;
    const onFocus = () => (made.enableZoom = true);
    const onBlur = () => (made.enableZoom = false);
    target.addEventListener('focus', onFocus);
    target.addEventListener('blur', onBlur);
    made.addEventListener('start', () => {
      moved.current = true;
      target.focus({ preventScroll: true });
    });
    const observer = new ResizeObserver(() => setSize([target.clientWidth, target.clientHeight]));
    observer.observe(target);
    setSize([target.clientWidth, target.clientHeight]);
    return () => {
      observer.disconnect();
      target.removeEventListener('focus', onFocus);
      target.removeEventListener('blur', onBlur);
      made.dispose();
      controls.current = null;
    };
  }, [camera, element]);

  useEffect(() => {
    const made = controls.current!;
    const [width, height] = size;
    if (width === 0 || height === 0) return;
    const draw = () => {
      camera.updateMatrixWorld();
      setProject(() => projection(camera, width, height));
    };
    made.addEventListener('change', draw);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (!moved.current) look('corner');
    draw();
    return () => made.removeEventListener('change', draw);
    // The key has all of the box.
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [camera, key, size]);

  const onKey = (event: JSX.TargetedKeyboardEvent<HTMLElement>) => {
    const made = controls.current;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => made?.rotateLeft(kTurn),
      ArrowRight: () => made?.rotateLeft(-kTurn),
      ArrowUp: () => made?.rotateUp(kTurn),
      ArrowDown: () => made?.rotateUp(-kTurn),
      '+': () => made?.dollyIn(kZoom),
      '-': () => made?.dollyOut(kZoom),
      Home: () => look('corner'),
    };
    if (!(event.key in actions) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    moved.current = true;
    actions[event.key]();
  };
  return { width: size[0], height: size[1], project, onKey, look };
}
