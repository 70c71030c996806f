// A camera led by a hand: it circles around a point, comes nearer, and moves sideways with what it looks at.

const TURN_SPEED = 4; // [rad] for a drag over the view's height
const ZOOM_STEP = 0.88; // of the distance for one notch of the wheel
const STEEPEST = (89.5 * Math.PI) / 180;

export class Orbit {
  target = [0, 0, 0];
  distance = 10; // [m]
  yaw = 0; // [rad] around y; 0: along -z
  pitch = -0.4; // [rad] upwards
  fieldOfView = 0.9;
  far = 500;
  isParallel = false;

  /** Stands where a camera stands, to circle around what is `distance` [m] before it. */
  take(camera, distance) {
    const forward = rotate(camera.rotation, [0, 0, -1]);
    this.distance = Math.max(distance, 1e-3);
    this.target = camera.position.map((place, axis) => place + forward[axis] * this.distance);
    this.yaw = Math.atan2(-forward[0], -forward[2]);
    this.pitch = clamp(Math.asin(clamp(forward[1], -1, 1)), -STEEPEST, STEEPEST);
    this.fieldOfView = camera.field_of_view;
    this.far = camera.far;
    this.isParallel = camera.ortho_height > 0;
    if (this.isParallel) this.distance = camera.ortho_height / (2 * Math.tan(this.fieldOfView / 2));
  }

  /** Circles by a drag of `x`, `y` view heights, right and down. */
  turn(x, y) {
    this.yaw -= x * TURN_SPEED;
    this.pitch = clamp(this.pitch - y * TURN_SPEED, -STEEPEST, STEEPEST);
  }

  /** Moves so that what is looked at stays under the pointer. */
  pan(x, y) {
    const rotation = this.#rotation();
    const [right, up] = [rotate(rotation, [1, 0, 0]), rotate(rotation, [0, 1, 0])];
    const height = 2 * this.distance * Math.tan(this.fieldOfView / 2);
    this.target = this.target.map((place, axis) => place - right[axis] * x * height + up[axis] * y * height);
  }

  /** Comes nearer by notches of the wheel, or goes away. */
  zoom(notches) {
    this.distance = clamp(this.distance * ZOOM_STEP ** notches, 1e-3, 1e6);
  }

  /** Looks at a point from where it is seen now. */
  lookAt(point, distance) {
    this.target = [...point];
    this.distance = clamp(distance, 1e-3, 1e6);
  }

  camera() {
    const rotation = this.#rotation();
    const forward = rotate(rotation, [0, 0, -1]);
    return {
      position: this.target.map((place, axis) => place - forward[axis] * this.distance),
      rotation,
      field_of_view: this.fieldOfView,
      ortho_height: this.isParallel ? 2 * this.distance * Math.tan(this.fieldOfView / 2) : 0,
      near: Math.max(this.distance * 2e-3, 1e-4),
      far: Math.max(this.far, this.distance * 20),
    };
  }

  /** Yaw about y, then pitch about the camera's x: quaternion x y z w. */
  #rotation() {
    const [a, b] = [this.yaw / 2, this.pitch / 2];
    return [Math.cos(a) * Math.sin(b), Math.sin(a) * Math.cos(b), -Math.sin(a) * Math.sin(b), Math.cos(a) * Math.cos(b)];
  }
}

/** A vector turned by a quaternion x y z w: v + 2 w (u × v) + 2 u × (u × v). */
export function rotate([x, y, z, w], [a, b, c]) {
  const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
}

/** Euler degrees about the fixed axes x, then y, then z, of a quaternion x y z w. */
export function degreesOf([x, y, z, w]) {
  const sine = clamp(2 * (w * y - z * x), -1, 1);
  const angles = [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
  return angles.map((angle) => (angle * 180) / Math.PI);
}

/** The quaternion x y z w of such degrees. */
export function quaternionOf(degrees) {
  const [a, b, c] = degrees.map((angle) => (angle * Math.PI) / 360);
  const [sx, cx, sy, cy, sz, cz] = [Math.sin(a), Math.cos(a), Math.sin(b), Math.cos(b), Math.sin(c), Math.cos(c)];
  return [
    sx * cy * cz - cx * sy * sz,
    cx * sy * cz + sx * cy * sz,
    cx * cy * sz - sx * sy * cz,
    cx * cy * cz + sx * sy * sz,
  ];
}

const clamp = (value, least, most) => Math.min(Math.max(value, least), most);
