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

export function clock(time: string | undefined): string {
  return time ? time.replace('T', ' ').replace(/\.\d+Z$|Z$/, ' UTC') : '';
}

// RUN_HELD_BACK -> run held back
export function words(name: string): string {
  return name.toLowerCase().replaceAll('_', ' ');
}

const kParts: Record<string, string> = {
  gyro: 'gyroscope',
  accel: 'accelerometer',
  focal: 'focal length',
  principal: 'principal point',
  time_offset: 'time offset',
  q_CI: 'rotation to the IMU',
  p_CI: 'position to the IMU',
};

// cam0.focal.x -> focal length of camera 0, x
export function component(name: string): string {
  const [device, first, ...rest] = name.split('.');
  const say = (part: string) => kParts[part] ?? part.replaceAll('_', ' ');
  const camera = /^cam(\d+)$/.exec(device);
  if (camera && first) {
    return [`${say(first)} of camera ${camera[1]}`, ...rest].join(', ');
  }
  if (first === 'q_AI') {
    return ['rotation of the accelerometer', ...rest].join(', ');
  }
  if (device === 'imu' && rest.length > 0) {
    const [what, ...axis] = rest;
    return [`${say(what)} of the ${say(first)}`, ...axis].join(', ');
  }
  return name;
}

// A number with its unit, if it has one.
export function quantity(value: number, unit: string, digits = 6): string {
  return number(value, digits) + (unit === '-' ? '' : ' ' + unit);
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

const kDegrees = 180 / Math.PI;

// Shows a rotation as its difference from the factory value, in degrees: a
// rotation vector near pi can change its sign although nothing has moved.
export function shown(estimate: {
  unit: string;
  value: number;
  sigma: number;
  fromFactory?: number;
}): { value: number; sigma: number; unit: string } {
  const { unit, value, sigma, fromFactory } = estimate;
  if (unit !== 'rad' || fromFactory === undefined) return { value, sigma, unit };
  return {
    value: kDegrees * fromFactory,
    sigma: kDegrees * sigma,
    unit: 'deg from factory',
  };
}
