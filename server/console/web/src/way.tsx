// The path of a device through a session: reads it, and draws it coloured by the
// entropy of each segment.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import {
  Failure,
  get,
  idOf,
  pageOf,
  type ApiError,
  type SessionOverview,
  type SessionPiece,
  type SessionTrajectory,
} from './api';
import { number } from './format';
import { Choice, Empty } from './parts';
import { go } from './state';
import { Scene, type Mark, type Strand } from './trajectory';

// Limits of what the page draws; the daemon thins out long sessions.
const kPages = 20;
const kPageSize = 1000;
const kSteps = 6; // number of colours

export interface Way {
  session: SessionOverview;
  pieces: SessionPiece[];
  whole: boolean; // no page is missing
}

async function readWay(path: string): Promise<Way> {
  const pieces: SessionPiece[] = [];
  let token = '';
  for (let page = 1; ; ++page) {
    const query = new URLSearchParams({ page_size: String(kPageSize), page_token: token });
    const read = await get<SessionTrajectory>(`${path}/trajectory?${query}`);
    pieces.push(...read.segments);
    token = read.nextPageToken;
    if (!token || page === kPages) {
      return { session: read.session, pieces, whole: !token };
    }
  }
}

// Reads the path of one session while the component is mounted. Reads again when
// something has changed, but never concurrently: reading a long session can take
// longer than recording its next segment.
export function useWay(path: string, version: number) {
  const [way, setWay] = useState<Way | null>(null);
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
      for (let done = -1; done !== now.wanted && !now.gone; ) {
        done = now.wanted;
        try {
          setWay(await readWay(path));
          setError(null);
        } catch (failure) {
          setError((failure as Failure).error);
        }
      }
      now.busy = false;
    };
    void read();
  }, [version]);
  return { value: error ? null : way, error };
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

export function entropyOf(piece: SessionPiece, group: string): number {
  const score = piece.scores.find((s) => s.group === group);
  return score ? Number(score.entropyNats) : NaN;
}

function Legend(props: { scale: Scale; counts: number[]; unknown: number }) {
  const { bounds } = props.scale;
  const range = (step: number) => {
    const [from, to] = [bounds[kSteps - 2 - step], bounds[kSteps - 1 - step]];
    if (from === undefined) return `under ${number(to, 4)}`;
    return to === undefined ? `${number(from, 4)} and more` : `${number(from, 4)} to ${number(to, 4)}`;
  };
  const sample = (name: string) => (
    <svg viewBox="0 0 40 12" class="sample" aria-hidden="true">
      <path d="M2 6L38 6" class={'way ' + name} />
    </svg>
  );
  return (
    <ul class="legend" aria-label="Entropy by colour">
      {Array.from({ length: kSteps }, (_, i) => kSteps - 1 - i).map((step) => (
        <li key={step}>
          {sample('info-' + step)} {range(step)} nats: {props.counts[step]}
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

export const isKept = (piece: SessionPiece) => piece.tables.length > 0;

function middle(piece: SessionPiece): number[] {
  const points = piece.positionsM.length / 3;
  const i = 3 * Math.floor(points / 2);
  return piece.positionsM.slice(i, i + 3);
}

function nameOf(piece: SessionPiece): string {
  return decodeURIComponent(idOf(piece.segment));
}

function say(piece: SessionPiece, group: string): string {
  const entropy = entropyOf(piece, group);
  return (
    nameOf(piece) +
    (Number.isNaN(entropy) ? ': no score' : `: entropy ${number(entropy, 4)} nats`) +
    (isKept(piece) ? `, kept for ${piece.tables.join(', ')}` : ', not kept')
  );
}

// Consecutive pieces are joined if the gap between them is small.
function wayOf(piece: SessionPiece, next: SessionPiece | undefined): number[] {
  const close = next && next.positionsM.length > 0 && joins(piece, next);
  return close ? [...piece.positionsM, ...next.positionsM.slice(0, 3)] : piece.positionsM;
}

const kMostGapNs = 1_000_000_000n;
function joins(piece: SessionPiece, next: SessionPiece): boolean {
  return BigInt(next.startNs) - BigInt(piece.endNs) <= kMostGapNs;
}

function strandsOf(drawn: SessionPiece[], group: string, scale: Scale): Strand[] {
  const ways = (of: (piece: SessionPiece) => boolean) =>
    drawn.flatMap((piece, i) => (of(piece) ? [wayOf(piece, drawn[i + 1])] : []));
  const stepOf = (piece: SessionPiece) => {
    const entropy = entropyOf(piece, group);
    return Number.isNaN(entropy) ? -1 : scale.stepOf(entropy);
  };
  const steps = Array.from({ length: kSteps }, (_, step) => step);
  const strands: Strand[] = [
    { ways: ways((piece) => stepOf(piece) < 0), class: 'unknown' },
    ...steps.map((step) => ({
      ways: ways((piece) => stepOf(piece) === step && !isKept(piece)),
      class: 'info-' + step,
    })),
    // Kept pieces are drawn on top, with an edge.
    { ways: ways(isKept), class: 'edge' },
    ...steps.map((step) => ({
      ways: ways((piece) => stepOf(piece) === step && isKept(piece)),
      class: 'kept info-' + step,
    })),
  ];
  return strands.filter((strand) => strand.ways.length > 0);
}

function Picture(props: { way: Way; group: string; scale: Scale }) {
  const { way, group, scale } = props;
  const [pointed, setPointed] = useState(-1);
  const drawn = useMemo(
    () => way.pieces.filter((piece) => piece.positionsM.length > 0),
    [way],
  );
  const strands = useMemo(() => strandsOf(drawn, group, scale), [drawn, group, scale]);
  const targets = useMemo(() => drawn.map(middle), [drawn]);
  const kept = useMemo(
    () =>
      drawn.filter(isKept).map((piece): Mark => ({
        at: middle(piece),
        class: piece.tables.includes(group) ? 'kept own' : 'kept',
        radius: 4.5,
        title: say(piece, group),
      })),
    [drawn, group],
  );
  if (drawn.length === 0) {
    return (
      <Empty>
        No positions of this session are stored: it was received before the daemon
        stored them. Its segments are listed with the others of the rig.
      </Empty>
    );
  }
  const now = drawn[pointed];
  const marks = now ? [...kept, { at: middle(now), class: 'now', radius: 8 }] : kept;
  return (
    <>
      <div class="wide">
        <Scene
          label={`Path of the device through session ${way.session.session}, coloured by the entropy of group ${group}; the tables below have the numbers`}
          strands={strands}
          marks={marks}
          width={720}
          height={400}
          targets={targets}
          onPoint={setPointed}
          onPick={() => now && go(pageOf(now.segment))}
        >
          Path of the IMU
        </Scene>
      </div>
      <p class="quiet">
        {now
          ? say(now, group) + '; click to open it'
          : 'Point at the path to see the segment. Thick pieces with a mark are kept; a filled mark means kept for this group.'}
      </p>
      {drawn.length < way.pieces.length && (
        <p class="quiet">
          {way.pieces.length - drawn.length} segments are not drawn: they were
          received before positions were stored.
        </p>
      )}
    </>
  );
}

// The path coloured by a group, with the menu that selects the group.
export function ColouredWay(props: {
  way: Way;
  groups: string[];
  group: string;
  onGroup: (group: string) => void;
}) {
  const { way, group } = props;
  const { scale, counts, unknown } = useMemo(() => {
    const entropies = way.pieces
      .map((piece) => entropyOf(piece, group))
      .filter((entropy) => !Number.isNaN(entropy));
    const scale = scaleOf(entropies);
    const counts = new Array<number>(kSteps).fill(0);
    for (const entropy of entropies) counts[scale.stepOf(entropy)]++;
    return { scale, counts, unknown: way.pieces.length - entropies.length };
  }, [way, group]);
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
      <Picture way={way} group={group} scale={scale} />
      <Legend scale={scale} counts={counts} unknown={unknown} />
      {!way.whole && (
        <p class="warning">
          Only the first {way.pieces.length} of {way.session.segments} segments are
          drawn.
        </p>
      )}
    </>
  );
}
