// Unit quaternions w, x, y, z, as small functions.

/** @type {(one: Iterable<number>, other: Iterable<number>) => number[]} */
export const multiplied = ([a, b, c, d], [w, x, y, z]) =>
  [a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w];

/** @type {(one: Iterable<number>) => number[]} */
export const inverse = ([w, x, y, z]) => [w, -x, -y, -z];

// The shortest turn from one way to another, of any lengths but zero.
export function aimed(from, to) {
  const [a, b] = [from, to].map((one) => { const long = Math.hypot(...one) || 1; return one.map((value) => value / long); });
  const dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  if (dot < -0.9999) { // half a turn: about any axis across
    const axis = Math.abs(a[0]) < 0.9 ? [0, a[2], -a[1]] : [-a[2], 0, a[0]], long = Math.hypot(...axis);
    return [0, ...axis.map((value) => value / long)];
  }
  const turned = [1 + dot, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const long = Math.hypot(...turned);
  return turned.map((value) => value / long);
}
