// The types of /api/v1; names and values are those of the contract, with 64-bit
// integers as strings.

export interface ApiError {
  code: string;
  message: string;
  whatToDo: string;
}

export class Failure extends Error {
  constructor(readonly error: ApiError) {
    super(error.message);
  }
}

export interface Grant {
  role: 'read' | 'produce' | 'administer';
  rig: string; // empty: every rig
}

export interface Session {
  caller: string;
  grants: Grant[];
  programVersion: string;
}

export interface RigOverview {
  name: string;
  createTime: string;
  lastSeen?: string;
  activeVersion: string;
  activeSince: string;
  tableEntries: number;
  tableCapacity: number;
  alarms: string[];
}

export interface Rig {
  name: string;
  createTime: string;
  groups: { group: string; patterns: string[] }[];
  tableSize: number;
  factory: { cameras: { widthPx: number; heightPx: number }[] };
}

export interface Estimate {
  component: string;
  unit: string;
  value: number;
  sigma: number;
  fromFactory?: number;
}

export interface Direction {
  parts: { component: string; weight: number }[];
  informationRatio: number;
}

export interface Solver {
  status: string;
  message: string;
  iterations: number;
  initialCost: number;
  finalCost: number;
  reprojectionRmsBeforePx: number;
  reprojectionRmsAfterPx: number;
  rank: number;
  components: number;
  heldConstant: Direction[];
  segments: number;
  keyframes: number;
  landmarks: number;
  observations: number;
  observationsDropped: number;
  seconds: number;
  noiseFactors: {
    kind: string;
    factor: number;
    logSigma: number;
    determined: boolean;
    used: number;
    converged: boolean;
  }[];
  segmentFits: {
    segment: string;
    pixelRatio: number;
    inertialRatio: number;
    excluded: string;
  }[];
  halves?: { chiSquare: number; degrees: number; probability: number };
}

export interface Calibration {
  name: string;
  version: string;
  state: string;
  createTime: string;
  estimates: Estimate[];
  reasons: string[];
  provenance?: {
    recalibration: string;
    baseVersion: string;
    segments: string[];
    programVersion: string;
  };
  solver?: Solver;
  verdict?: { kind: string; text: string; sentences: string[] };
  validation?: {
    verdict: string;
    activeVersion: string;
    checks: {
      name: string;
      value: number;
      limit: number;
      passed: boolean;
      outcome: string;
      sentence: string;
    }[];
    heldOut?: {
      segments: number;
      rescored: number;
      degrees: number;
      chiSquare: number;
      probability: number;
      activeChiSquare: number;
      activeProbability: number;
    };
  };
}

export interface Comparison {
  versionA: string;
  versionB: string;
  differences: {
    component: string;
    unit: string;
    valueA: number;
    valueB: number;
    difference: number;
    sigma: number;
    fromFactoryA?: number;
    fromFactoryB?: number;
  }[];
  chiSquare: number;
  degrees: number;
  probability: number;
  significant: boolean;
  sharedSegments: number;
}

export interface Table {
  name: string;
  capacity: number;
  entries: { segment: string; entropyNats: number; gainNats: number }[];
  scored: string;
  starved: boolean;
}

export interface Segment {
  name: string;
  state: string;
  hasData: boolean;
  payloadBytes: string;
  receiveTime: string;
  keyframes: number;
  imuSamples: number;
  landmarks: number;
  observations: number;
  calibrationVersion: string;
  startNs: string;
  endNs: string;
  sequence: string;
  scores: {
    group: string;
    size: number;
    entropyNats: number;
    gainNats: number;
    rank: number;
    unobserved: Direction[];
    inTable: boolean;
  }[];
  residuals?: {
    observations: number;
    inliers: number;
    outliers: number;
    reprojectionRmsPx: number;
    reprojectionMedianPx: number;
    manyOutliers: boolean;
  };
  rank: number;
  components: number;
  unobserved: Direction[];
  problem: string;
  temperatureC?: number;
}

export interface SegmentData {
  keyframes: { tNs: string[]; qGi: number[]; pGi: number[] };
  imu: { tNs: string[]; gyro: number[]; accel: number[] };
  observations: {
    keyframe: number[];
    camera: number[];
    landmark: number[];
    zPx: number[];
  };
}

export interface Absence {
  group: string;
  cause: string;
  time: string;
  rival: string; // a segment
  rivalEntropyNats?: number;
  fit?: number; // its residuals, relative to what is expected
  fitLimit?: number;
}

// The information of one segment about a component.
export interface ComponentInformation {
  component: string;
  unit: string;
  priorSigma: number;
  sigma: number;
}

export interface SegmentResiduals {
  calibrationVersion: string;
  residualPx: number[]; // 2 for each observation
  unused: number[]; // observations
  notProjectable: number[];
  cameras: {
    camera: number;
    observations: number;
    inliers: number;
    inlierRmsPx: number;
  }[];
  intervals?: { residual: number[]; whitened: number[] }; // 15 each
  reprojectionMedianPx: number;
  inertialRms: number[];
}

export interface SessionOverview {
  name: string;
  session: string;
  segments: string;
  firstReceived: string;
  lastReceived: string;
}

export interface SessionPiece {
  segment: string;
  scored: boolean;
  hasData: boolean;
  startNs: string;
  endNs: string;
  seconds: number[];
  positionsM: number[];
  scores: { group: string; entropyNats: number; gainNats: number }[];
  tables: string[];
}

export interface SessionTrajectory {
  session: SessionOverview;
  segments: SessionPiece[];
  nextPageToken: string;
}

export interface ComponentProgress {
  component: string;
  unit: string;
  value: number;
  moved: number; // difference to the start value
  sigma: number;
}

export interface Run {
  name: string;
  state: string;
  trigger: string;
  createTime: string;
  endTime?: string;
  segments: string[];
  iteration: number;
  maxIterations: number;
  cost: number;
  stepSigmas: number;
  calibration: string;
  message: string;
  attempts: number;
  solver?: Solver;
  parameters: ComponentProgress[]; // only in the stream
}

export interface Advice {
  motion: string;
  instruction: string;
  gainNats: number;
  groupGains: { group: string; gainNats: number }[];
  sigmaChanges: {
    component: string;
    unit: string;
    sigmaNow: number;
    sigmaAfter: number;
  }[];
}

export interface Coaching {
  advice: Advice[]; // most informative first
  weakest: {
    words: string;
    sigmaByReference: number;
    parts: Direction['parts'];
  }[];
  calibrationVersion: string;
  segmentsSince: number;
  segmentSeconds: number;
}

export interface Event {
  number: string;
  time: string;
  rig: string;
  kind: string;
  detail: string;
}

async function answer<T>(response: Response): Promise<T> {
  const text = await response.text();
  let body: unknown;
  try {
    body = JSON.parse(text);
  } catch {
    body = null;
  }
  if (response.ok && body !== null) return body as T;
  const error = body as ApiError | null;
  throw new Failure(
    error?.code
      ? error
      : {
          code: String(response.status),
          message: 'The response of the daemon cannot be read.',
          whatToDo: 'Reload the page; see the log of selfcald.',
        },
  );
}

async function reach(path: string, init?: RequestInit): Promise<Response> {
  try {
    return await fetch('/api/v1/' + path, init);
  } catch {
    throw new Failure({
      code: 'UNAVAILABLE',
      message: 'The daemon does not answer.',
      whatToDo: 'Check that selfcald is running; this page reconnects by itself.',
    });
  }
}

export async function get<T>(path: string): Promise<T> {
  return answer<T>(await reach(path));
}

export async function post<T>(path: string, body: unknown): Promise<T> {
  return answer<T>(
    await reach(path, {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'X-Selfcal-Console': '1' },
      body: JSON.stringify(body),
    }),
  );
}

// The last part of a resource name, encoded as in an address.
export function idOf(name: string): string {
  return name.slice(name.lastIndexOf('/') + 1);
}

// The path of a rig under /api/v1.
export function rigPath(rig: string): string {
  return 'rigs/' + encodeURIComponent(rig);
}

// The address of the page of a resource, which is that of its name.
export function pageOf(name: string): string {
  return '/' + name.split('/').map(encodeURIComponent).join('/');
}

export function mayActivate(session: Session | null, rig: string): boolean {
  return (session?.grants ?? []).some(
    (grant) =>
      grant.role === 'administer' && (grant.rig === '' || grant.rig === rig),
  );
}
