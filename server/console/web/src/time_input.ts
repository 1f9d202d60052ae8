// Points in time that people enter, written as on the command line.

export const kTimeHint = 'Use 2026-11-21, 2026-11-21 04:10:03 (UTC), or 30s, 15m, 2h, 7d ago.';

const kSeconds: Record<string, number> = { s: 1, m: 60, h: 3600, d: 86400 };
const kHundredYears = 36525 * kSeconds.d;

// The seconds of a text as 7d, at most a hundred years.
function ageOf(text: string): number | null {
  const [, count, unit] = /^(\d+)([smhd])$/.exec(text) ?? [];
  if (!unit) return null;
  const seconds = Number(count) * kSeconds[unit];
  return seconds <= kHundredYears ? seconds : null;
}

// The time of a text, to the millisecond; null if it is not a time. An age is
// subtracted from `now`.
export function timeOf(text: string, now: Date): Date | null {
  const age = ageOf(text);
  if (age !== null) return new Date(now.getTime() - 1000 * age);
  const [, date, clock = '00:00:00', fraction = ''] =
    /^(\d{4}-\d\d-\d\d)(?:[ T](\d\d:\d\d:\d\d)(\.\d{1,9})?Z?)?$/.exec(text) ?? [];
  if (!date) return null;
  const time = new Date(`${date}T${clock}${fraction}Z`);
  // A day that its month does not have becomes one of the next month.
  const isValid = !isNaN(time.getTime()) && time.toISOString().startsWith(`${date}T${clock}`);
  return isValid ? time : null;
}
