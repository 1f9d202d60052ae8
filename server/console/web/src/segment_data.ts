// The data of a segment, as the pages draw it.
import type { MotionSegment } from './contract';

export type SegmentData = Required<Pick<MotionSegment, 'keyframes' | 'imu' | 'observations'>> &
  Pick<MotionSegment, 'imu1'>; // of the second IMU, if there is one

// Returns null for a segment without keyframes or IMU samples, of which there
// is nothing to draw.
export function drawable(segment: MotionSegment): SegmentData | null {
  const { keyframes, imu, imu1 } = segment;
  if (!keyframes?.tNs.length || !imu?.tNs.length) return null;
  const observations = segment.observations ?? {
    keyframe: [],
    camera: [],
    landmark: [],
    zPx: [],
  };
  return { keyframes, imu, imu1: imu1?.tNs.length ? imu1 : undefined, observations };
}
