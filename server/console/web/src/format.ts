// Times, numbers and names in a form for people.

export function number(value: number | string, digits = 3): string {
  const x = Number(value);
  if (!Number.isFinite(x)) return String(value);
  if (x === 0) return '0';
  const size = Math.abs(x);
  if (size >= 1e5 || size < 1e-3) return x.toExponential(digits - 1);
  return String(Number(x.toPrecision(Math.max(digits, Math.floor(Math.log10(size)) + 1))));
}

export function bytes(value: number | string): string {
  let x = Number(value);
  for (const unit of ['B', 'KiB', 'MiB']) {
    if (x < 1024) return number(x) + ' ' + unit;
    x /= 1024;
  }
  return number(x) + ' GiB';
}

export function ago(time: string | undefined): string {
  if (!time) return 'never';
  const seconds = Math.max(0, (Date.now() - Date.parse(time)) / 1000);
  const steps: [number, string][] = [
    [60, 'second'],
    [60, 'minute'],
    [24, 'hour'],
    [Infinity, 'day'],
  ];
  let x = seconds;
  for (const [size, unit] of steps) {
    if (x < size) {
      const count = Math.floor(x);
      return count === 0 && unit === 'second'
        ? 'now'
        : `${count} ${unit}${count === 1 ? '' : 's'} ago`;
    }
    x /= size;
  }
  return time;
}

const kSeconds: [number, string][] = [
  [86400, 'd'],
  [3600, 'h'],
  [60, 'min'],
  [1, 's'],
];

// 30 d; 'none' for a time of 0, which a rig does not limit.
export function durationText(seconds: number): string {
  if (seconds === 0) return 'none';
  const [size, unit] = kSeconds.find(([size]) => seconds % size === 0) ?? [1, 's'];
  return `${seconds / size} ${unit}`;
}

// The seconds of a text as 12 h, to the millisecond; null if it is not a time.
export function secondsOf(text: string): number | null {
  if (/^\s*0\s*$/.test(text)) return 0;
  const [, value, unit] = /^\s*(\d+(?:\.\d+)?)\s*([a-z]+)\s*$/.exec(text) ?? [];
  const size = kSeconds.find(([, name]) => name === unit)?.[0];
  return size === undefined ? null : Math.round(1000 * size * Number(value)) / 1000;
}

export function clock(time: string | undefined): string {
  return time ? time.replace('T', ' ').replace(/\.\d+Z$|Z$/, ' UTC') : '';
}

// RUN_DEFERRED -> run deferred
export function words(name: string): string {
  return name.toLowerCase().replaceAll('_', ' ');
}

const kParts: Record<string, string> = {
  gyro: 'gyroscope',
  accel: 'accelerometer',
  focal: 'focal length',
  principal: 'principal point',
  time_offset: 'time offset',
  line_delay: 'line delay',
  time_drift: 'drift of the clock',
  q_AI: 'rotation of the accelerometer',
  q_CI: 'rotation to the IMU',
  p_CI: 'position to the IMU',
  q_JI: 'rotation to the first IMU',
  p_JI: 'position to the first IMU',
};

// The name of a block that is the slope of another one with temperature ends so.
const kSlope = '_slope';

// cam0.focal_slope.x
export function isSlope(name: string): boolean {
  return name.split('.').some((part) => part.endsWith(kSlope));
}

// cam0.focal.x -> focal length of camera 0, x
export function component(name: string): string {
  const [device, first, ...rest] = name.split('.');
  const say = (part: string): string =>
    part.endsWith(kSlope)
      ? `${say(part.slice(0, -kSlope.length))} per kelvin`
      : (kParts[part] ?? part.replaceAll('_', ' '));
  const camera = /^cam(\d+)$/.exec(device);
  if (camera && first) {
    return [`${say(first)} of camera ${camera[1]}`, ...rest].join(', ');
  }
  if (!['imu', 'imu1'].includes(device) || !first) return name;
  const owner = device === 'imu1' ? ' of the second IMU' : '';
  if (rest.length === 0 || /^(q_AI|q_JI|p_JI)/.test(first)) {
    return [say(first) + owner, ...rest].join(', ');
  }
  const [what, ...axis] = rest;
  return [`${say(what)} of the ${say(first)}${owner}`, ...axis].join(', ');
}

// 'angle [°]'; a quantity without a unit has none in its heading.
export function heading(name: string, unit: string): string {
  return unit === '-' ? name : `${name} [${unit}]`;
}

const kMostDecimals = 9;

// The decimals of a standard deviation with two significant digits, to which its
// value is rounded, too.
function decimalsOf(sigma: number): number {
  return Math.min(kMostDecimals, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
}

const isUsable = (sigma: number) => Number.isFinite(sigma) && sigma > 0;

// A value, with as many digits as its standard deviation justifies.
export function valueText(value: number, sigma: number): string {
  if (!isUsable(sigma) || !Number.isFinite(value)) return number(value, 6);
  const text = value.toFixed(decimalsOf(sigma));
  return Number(text) === 0 ? text.replace('-', '') : text;
}

// A standard deviation with two significant digits.
export function sigmaText(sigma: number): string {
  if (!isUsable(sigma)) return '';
  const text = sigma.toFixed(decimalsOf(sigma));
  return Number(text) > 0 ? text : sigma.toExponential(1);
}

// A value with its standard deviation and its unit.
export function estimateText(value: number, sigma: number, unit: string): string {
  const both = `${valueText(value, sigma)} ± ${sigmaText(sigma)}`;
  return unit === '-' ? both : `${both} ${unit}`;
}

// Matches a pattern, which may have a '*' at either end.
export function matches(pattern: string, name: string): boolean {
  const text = pattern.replace(/^\*|\*$/g, '');
  const open = pattern.startsWith('*');
  const end = pattern.endsWith('*');
  if (open && end) return name.includes(text);
  if (open) return name.endsWith(text);
  if (end) return name.startsWith(text);
  return name === pattern;
}

// Degrees in a radian.
export const kDegrees = 180 / Math.PI;

// The unit in which the pages show a quantity, and its size: angles in degrees.
export function shownUnit(unit: string): { unit: string; factor: number } {
  if (unit === 'rad') return { unit: '°', factor: kDegrees };
  return { unit, factor: 1 };
}

// An estimate in the unit in which it is shown. A rotation is shown as its
// difference from the factory value: a rotation vector near pi can change its
// sign although nothing has moved.
export function shown(estimate: {
  unit: string;
  value: number;
  sigma: number;
  fromFactory?: number;
}): { value: number; sigma: number; unit: string } {
  const { unit, factor } = shownUnit(estimate.unit);
  const relative = estimate.unit === 'rad' && estimate.fromFactory !== undefined;
  return {
    value: factor * (relative ? estimate.fromFactory! : estimate.value),
    sigma: factor * estimate.sigma,
    unit: relative ? unit + ' from the factory value' : unit,
  };
}
