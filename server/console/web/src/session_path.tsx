// The path of a device through a session: reads it, and draws it coloured by the
// entropy of each segment.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { Failure, get, idOf, pageOf, type ApiError } from './api';
import type { Session, SessionTrajectory, TrajectorySegment } from './contract';
import { number } from './format';
import { Choice, Empty } from './parts';
import { go } from './state';
import { Scene, type Mark, type Strand } from './trajectory';

// Limits of what the page draws; the daemon thins out long sessions.
const kPages = 20;
const kPageSize = 1000;
const kSteps = 6; // number of colours

export interface SessionPath {
  session: Session;
  segments: TrajectorySegment[];
  whole: boolean; // no page is missing
}

async function readSessionPath(path: string): Promise<SessionPath> {
  const segments: TrajectorySegment[] = [];
  let token = '';
  for (let page = 1; ; ++page) {
    const query = new URLSearchParams({ page_size: String(kPageSize), page_token: token });
    const read = await get<SessionTrajectory>(`${path}/trajectory?${query}`);
    segments.push(...read.segments);
    token = read.nextPageToken;
    if (!token || page === kPages) {
      return { session: read.session!, segments, whole: !token };
    }
  }
}

// Reads the path of one session while the component is mounted. Reads again when
// something has changed, but never concurrently: reading a long session can take
// longer than recording its next segment.
export function useSessionPath(path: string, version: number) {
  const [sessionPath, setSessionPath] = useState<SessionPath | null>(null);
  const [error, setError] = useState<ApiError | null>(null);
  const state = useRef({ wanted: version, busy: false, gone: false });
  useEffect(() => {
    const now = state.current;
    now.gone = false;
    return () => {
      now.gone = true;
    };
  }, []);
  useEffect(() => {
    const now = state.current;
    now.wanted = version;
    if (now.busy) return;
    now.busy = true;
    const read = async () => {
      for (let done = -1; done !== now.wanted && !now.gone;) {
        done = now.wanted;
        try {
          setSessionPath(await readSessionPath(path));
          setError(null);
        } catch (failure) {
          setError((failure as Failure).error);
        }
      }
      now.busy = false;
    };
    void read();
  }, [path, version]);
  return { value: error ? null : sessionPath, error };
}

// ------------------------------------------------------------- colours

interface Scale {
  bounds: number[]; // between the steps, ascending
  stepOf: (entropy: number) => number; // 0: least informative
}

// Steps with equal numbers of segments. Entropies of rest and of motion are far
// apart, so that with steps of equal width all motion would look alike.
function scaleOf(entropies: number[]): Scale {
  const sorted = [...entropies].sort((a, b) => a - b);
  const bounds = Array.from(
    { length: kSteps - 1 },
    (_, i) => sorted[Math.floor(((i + 1) * sorted.length) / kSteps)] ?? 0,
  );
  return {
    bounds,
    stepOf: (entropy) => bounds.filter((bound) => entropy < bound).length,
  };
}

export function entropyOf(segment: TrajectorySegment, group: string): number {
  const score = segment.scores.find((s) => s.group === group);
  return score ? Number(score.entropyNats) : NaN;
}

function Legend(props: { scale: Scale; counts: number[]; unknown: number }) {
  const { bounds } = props.scale;
  const range = (step: number) => {
    const [from, to] = [bounds[kSteps - 2 - step], bounds[kSteps - 1 - step]];
    if (from === undefined) return `under ${number(to, 4)}`;
    return to === undefined
      ? `${number(from, 4)} and more`
      : `${number(from, 4)} to ${number(to, 4)}`;
  };
  const sample = (name: string) => (
    <svg viewBox="0 0 40 12" class="sample" aria-hidden="true">
      <path d="M2 6L38 6" class={'strand ' + name} />
    </svg>
  );
  return (
    <ul class="legend" aria-label="Entropy by colour">
      {Array.from({ length: kSteps }, (_, i) => kSteps - 1 - i).map((step) => (
        <li key={step}>
          {sample('info-' + step)} {range(step)} nat: {props.counts[step]}
          {step === kSteps - 1 ? ', most informative' : step === 0 ? ', least informative' : ''}
        </li>
      ))}
      {props.unknown > 0 && (
        <li>
          {sample('unknown')} no score: {props.unknown}
        </li>
      )}
    </ul>
  );
}

// ------------------------------------------------------------- the picture

export const isKept = (segment: TrajectorySegment) => segment.tables.length > 0;

function middle(segment: TrajectorySegment): number[] {
  const points = segment.positionsM.length / 3;
  const i = 3 * Math.floor(points / 2);
  return segment.positionsM.slice(i, i + 3);
}

function nameOf(segment: TrajectorySegment): string {
  return decodeURIComponent(idOf(segment.segment));
}

function describe(segment: TrajectorySegment, group: string): string {
  const entropy = entropyOf(segment, group);
  return (
    nameOf(segment) +
    (Number.isNaN(entropy) ? ': no score' : `: entropy ${number(entropy, 4)} nat`) +
    (isKept(segment) ? `, kept for ${segment.tables.join(', ')}` : ', not kept')
  );
}

// Consecutive segments are joined if the gap between them is small.
function lineOf(segment: TrajectorySegment, next: TrajectorySegment | undefined): number[] {
  const close = next && next.positionsM.length > 0 && joins(segment, next);
  return close ? [...segment.positionsM, ...next.positionsM.slice(0, 3)] : segment.positionsM;
}

const kMostGapNs = 1_000_000_000n;
function joins(segment: TrajectorySegment, next: TrajectorySegment): boolean {
  return BigInt(next.startNs) - BigInt(segment.endNs) <= kMostGapNs;
}

function strandsOf(drawn: TrajectorySegment[], group: string, scale: Scale): Strand[] {
  const lines = (of: (segment: TrajectorySegment) => boolean) =>
    drawn.flatMap((segment, i) => (of(segment) ? [lineOf(segment, drawn[i + 1])] : []));
  const stepOf = (segment: TrajectorySegment) => {
    const entropy = entropyOf(segment, group);
    return Number.isNaN(entropy) ? -1 : scale.stepOf(entropy);
  };
  const steps = Array.from({ length: kSteps }, (_, step) => step);
  const strands: Strand[] = [
    { lines: lines((segment) => stepOf(segment) < 0), class: 'unknown' },
    ...steps.map((step) => ({
      lines: lines((segment) => stepOf(segment) === step && !isKept(segment)),
      class: 'info-' + step,
    })),
    // Kept segments are drawn on top, with an edge.
    { lines: lines(isKept), class: 'edge' },
    ...steps.map((step) => ({
      lines: lines((segment) => stepOf(segment) === step && isKept(segment)),
      class: 'kept info-' + step,
    })),
  ];
  return strands.filter((strand) => strand.lines.length > 0);
}

function Picture(props: { sessionPath: SessionPath; group: string; scale: Scale }) {
  const { sessionPath, group, scale } = props;
  const [pointed, setPointed] = useState(-1);
  const drawn = useMemo(
    () => sessionPath.segments.filter((segment) => segment.positionsM.length > 0),
    [sessionPath],
  );
  const strands = useMemo(() => strandsOf(drawn, group, scale), [drawn, group, scale]);
  const targets = useMemo(() => drawn.map(middle), [drawn]);
  const kept = useMemo(
    () =>
      drawn.filter(isKept).map((segment): Mark => ({
        at: middle(segment),
        class: segment.tables.includes(group) ? 'kept own' : 'kept',
        radius: 4.5,
        title: describe(segment, group),
      })),
    [drawn, group],
  );
  if (drawn.length === 0) {
    return (
      <Empty>
        No positions of this session are stored: it was received before the daemon stored them. Its
        segments are listed with the others of the rig.
      </Empty>
    );
  }
  const now = drawn[pointed];
  const marks = now ? [...kept, { at: middle(now), class: 'now', radius: 8 }] : kept;
  return (
    <>
      <div class="wide">
        <Scene
          label={`Path of the IMU through session ${sessionPath.session.session}, coloured by the entropy of group ${group}; the tables below have the numbers`}
          strands={strands}
          marks={marks}
          targets={targets}
          onPoint={setPointed}
          onPick={() => now && go(pageOf(now.segment))}
        >
          Path of the IMU in the frame of the session.
        </Scene>
      </div>
      <p class="quiet">
        {now
          ? describe(now, group) + '; click to open it'
          : 'Point at the path to see the segment. Thick segments with a mark are kept; a filled mark means kept for this group.'}
      </p>
      {drawn.length < sessionPath.segments.length && (
        <p class="quiet">
          {sessionPath.segments.length - drawn.length} segments are not drawn: they were received
          before positions were stored.
        </p>
      )}
    </>
  );
}

// The path coloured by a group, with the menu that selects the group.
export function ColouredPath(props: {
  sessionPath: SessionPath;
  groups: string[];
  group: string;
  onGroup: (group: string) => void;
}) {
  const { sessionPath, group } = props;
  const { scale, counts, unknown } = useMemo(() => {
    const entropies = sessionPath.segments
      .map((segment) => entropyOf(segment, group))
      .filter((entropy) => !Number.isNaN(entropy));
    const scale = scaleOf(entropies);
    const counts = new Array<number>(kSteps).fill(0);
    for (const entropy of entropies) counts[scale.stepOf(entropy)]++;
    return { scale, counts, unknown: sessionPath.segments.length - entropies.length };
  }, [sessionPath, group]);
  return (
    <>
      <div class="bar">
        <Choice
          label="Coloured by the entropy of"
          value={group}
          of={props.groups.map((name) => [name, name])}
          onChoice={props.onGroup}
        />
      </div>
      <Picture sessionPath={sessionPath} group={group} scale={scale} />
      <Legend scale={scale} counts={counts} unknown={unknown} />
      {!sessionPath.whole && (
        <p class="warning">
          Only the first {sessionPath.segments.length} of {sessionPath.session.segments} segments
          are drawn.
        </p>
      )}
    </>
  );
}
