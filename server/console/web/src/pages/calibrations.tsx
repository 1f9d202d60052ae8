import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import { ActionDialog, mayAdminister } from '../action';
import { idOf, pageOf, post, rigPath } from '../api';
import type {
  Calibration,
  Caller,
  CompareCalibrationsResponse,
  ListCalibrationsResponse,
  SolverReport,
} from '../contract';
import { component, number, quantity, shown, words } from '../format';
import {
  Badge,
  Choice,
  DataTable,
  Figures,
  Link,
  Loaded,
  Problem,
  SegmentLink,
  SegmentLinks,
  solverFigures,
  Title,
  When,
} from '../parts';
import { kColours, Plot } from '../plot';
import { go, useAddress, useRead, withQuery } from '../state';

const kBand = 2; // half width of the band, in sigmas

// The estimate in the unit in which it is shown.
function estimateOf(version: Calibration, name: string) {
  const estimate = version.estimates.find((e) => e.component === name);
  return estimate && shown(estimate);
}

function History(props: { of: Calibration[] }) {
  const query = useAddress().searchParams;
  const [factory, setFactory] = useState(props.of.length === 1);
  // The factory's sigmas are so large that later versions would look flat.
  const versions = useMemo(
    () => [...props.of].reverse().filter((v) => factory || v.version !== '1'),
    [props.of, factory],
  );
  const names = versions[0].estimates.filter((e) => e.sigma > 0).map((e) => e.component);
  const chosen = query.get('parameter') ?? names[0];
  const data = useMemo(() => {
    const at = versions.map((v) => estimateOf(v, chosen));
    return [
      versions.map((v) => Number(v.version)),
      at.map((e) => e?.value ?? null),
      at.map((e) => (e ? e.value + kBand * e.sigma : null)),
      at.map((e) => (e ? e.value - kBand * e.sigma : null)),
    ] as uPlot.AlignedData;
  }, [versions, chosen]);
  const unit = estimateOf(versions[0], chosen)?.unit ?? '';
  const bound = { stroke: kColours[0] + '66', width: 1, points: { show: false } };
  return (
    <>
      <div class="bar">
        <Choice
          label="Parameter"
          value={chosen}
          of={names.map((name) => [name, component(name)])}
          onChoice={(parameter) => go(withQuery({ parameter }), true)}
        />
        {props.of.length > 1 && (
          <label>
            <input
              type="checkbox"
              checked={factory}
              onChange={(event) => setFactory(event.currentTarget.checked)}
            />
            with the factory calibration
          </label>
        )}
      </div>
      <Plot
        label={`${component(chosen)} over the versions, with a band of two sigmas`}
        data={data}
        x={{ label: 'version', integers: true }}
        y={unit === '-' ? 'value' : unit}
        series={[
          {
            label: component(chosen),
            stroke: kColours[0],
            width: 2,
            points: { show: true, size: 7 },
          },
          { label: 'plus two sigmas', ...bound },
          { label: 'minus two sigmas', ...bound },
        ]}
        bands={[{ series: [2, 3], fill: kColours[0] + '22' }]}
      />
    </>
  );
}

function Difference(props: { rig: string; of: Calibration[] }) {
  const query = useAddress().searchParams;
  const newest = props.of[0].version;
  const a = query.get('a') ?? props.of[1]?.version ?? newest;
  const b = query.get('b') ?? newest;
  const other = new URLSearchParams({ b: `rigs/${props.rig}/calibrations/${b}` });
  const read = useRead<CompareCalibrationsResponse>(
    `${rigPath(props.rig)}/calibrations/${encodeURIComponent(a)}:compare?${other}`,
  );
  const choose = (which: 'a' | 'b', value: string, name: string) => (
    <Choice
      label={name}
      value={value}
      of={props.of.map((c) => [c.version, c.version])}
      onChoice={(version) => go(withQuery({ a, b, [which]: version }), true)}
    />
  );
  return (
    <>
      <h2>Difference of two versions</h2>
      <div class="bar">
        {choose('a', a, 'From version')}
        {choose('b', b, 'to version')}
      </div>
      <Loaded read={read}>
        {(compared) => (
          <>
            <p>
              {compared.degrees === 0
                ? 'Neither version determines a direction clearly better than the factory: nothing can be compared.'
                : `Together they differ by ${compared.significant ? 'more' : 'no more'} than their uncertainty explains: chi-square ${number(compared.chiSquare)} with ${compared.degrees} degrees of freedom, probability ${number(compared.probability)}.`}
            </p>
            <DataTable
              caption={`Version ${compared.versionB} minus version ${compared.versionA}`}
              head={[
                'Parameter',
                `Version ${compared.versionA}`,
                `Version ${compared.versionB}`,
                'Difference',
                'Sigma',
                'In sigmas',
              ]}
              rows={compared.differences.map((d) => {
                const sigmas = Math.abs(d.difference) / d.sigma;
                const side = (value: number, fromFactory?: number) =>
                  shown({ ...d, value, fromFactory });
                const a = side(d.valueA, d.fromFactoryA);
                const b = side(d.valueB, d.fromFactoryB);
                const by = side(
                  d.difference,
                  d.fromFactoryA === undefined ? undefined : d.difference,
                );
                return [
                  component(d.component),
                  quantity(a.value, a.unit),
                  quantity(b.value, b.unit),
                  number(by.value),
                  number(by.sigma),
                  <span class={sigmas > 3 ? 'strong' : ''}>
                    {d.sigma > 0 ? number(sigmas, 2) : ''}
                  </span>,
                ];
              })}
            />
          </>
        )}
      </Loaded>
    </>
  );
}

function Activate(props: { calibration: Calibration; active: string; onEnd: () => void }) {
  const { calibration } = props;
  const back = Number(calibration.version) < Number(props.active);
  return (
    <ActionDialog
      title={`${back ? 'Roll back to' : 'Activate'} version ${calibration.version}?`}
      button={back ? 'Roll back' : 'Activate'}
      act={async (reason) => {
        await post(calibration.name + ':activate', { reason });
      }}
      onEnd={props.onEnd}
    >
      <p>
        Every device that watches this rig receives it at once, and uses it in place of version{' '}
        {props.active}. The event log records the reason.
      </p>
    </ActionDialog>
  );
}

const kOutcomes: Record<string, string> = {
  PASSED: 'passed',
  FAILED: 'failed',
  NOT_TESTED: 'not tested',
};

function Verdict(props: { of: Calibration }) {
  const verdict = props.of.verdict;
  if (!verdict) return null;
  return (
    <>
      <p>
        Verdict: <Badge state={verdict.kind} />
      </p>
      {verdict.sentences.map((sentence) => (
        <p class={verdict.kind === 'NOT_TRUSTWORTHY' ? 'warning' : 'quiet'} key={sentence}>
          {sentence}
        </p>
      ))}
    </>
  );
}

function Validation(props: { of: Calibration }) {
  const validation = props.of.validation;
  if (!validation) return null;
  const held = validation.heldOut;
  return (
    <>
      <h3>
        Validation <Badge state={validation.verdict} />
      </h3>
      <p class="quiet">Validated against version {validation.activeVersion}.</p>
      <DataTable
        caption="Checks"
        head={['Check', 'Value', 'Limit', 'Outcome']}
        rows={validation.checks.map((check) => {
          const outcome = kOutcomes[check.outcome] ?? (check.passed ? 'passed' : 'failed');
          const made = outcome !== 'not tested';
          return [
            words(check.name),
            made ? number(check.value) : '',
            made ? number(check.limit) : '',
            outcome === 'failed' ? <strong>{outcome}</strong> : outcome,
          ];
        })}
      />
      {held && held.degrees > 0 && (
        <p>
          On {held.segments} held-out segments ({held.rescored} rescored): chi-square{' '}
          {number(held.chiSquare)} with {held.degrees} degrees of freedom (probability{' '}
          {number(held.probability)}); the version before: {number(held.activeChiSquare)}.
        </p>
      )}
    </>
  );
}

function Origin(props: { of: Calibration }) {
  const from = props.of.provenance;
  if (!from) return <p>From the factory: its sigmas are the tolerances.</p>;
  return (
    <>
      <p>
        Computed by <Link to={pageOf(from.recalibration)}>run {idOf(from.recalibration)}</Link> of
        selfcald {from.programVersion}, starting from version {from.baseVersion}, from{' '}
        {from.segments.length} segments:
      </p>
      <SegmentLinks names={from.segments} />
    </>
  );
}

function Noise(props: { of: SolverReport }) {
  if (props.of.noiseFactors.length === 0) return null;
  return (
    <DataTable
      caption="Noise scales, relative to what the rig states"
      head={['Kind', 'Residuals suggest', 'Used']}
      rows={props.of.noiseFactors.map((factor) => [
        words(factor.kind),
        factor.determined
          ? `${number(factor.factor)} (+- ${number(100 * factor.logSigma, 2)} %)`
          : 'not determined',
        factor.used === 0 ? '' : number(factor.used) + (factor.converged ? '' : ' (not converged)'),
      ])}
    />
  );
}

// The fit of each segment, where it was measured.
function Fits(props: { of: SolverReport }) {
  if (props.of.segmentFits.length === 0) return null;
  return (
    <DataTable
      caption="Residuals of each segment, relative to what the noise predicts"
      head={['Segment', 'Pixels', 'IMU', 'Excluded']}
      rows={props.of.segmentFits.map((fit) => [
        <SegmentLink name={fit.segment} />,
        fit.pixelRatio > 0 ? number(fit.pixelRatio) : '',
        fit.inertialRatio > 0 ? number(fit.inertialRatio) : '',
        fit.excluded,
      ])}
    />
  );
}

function Version(props: { of: Calibration }) {
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => heading.current?.scrollIntoView(), [props.of.version]);
  const solver = props.of.solver;
  return (
    <section>
      <h2 ref={heading}>
        Version {props.of.version} <Badge state={props.of.state} />
      </h2>
      <Verdict of={props.of} />
      <Origin of={props.of} />
      {solver && (
        <Figures
          of={[
            ['Solver', solver.status],
            ...Object.values(solverFigures(solver)),
            [
              'Observations used',
              `${solver.observations} of ${solver.observations + solver.observationsDropped}`,
            ],
          ]}
        />
      )}
      <Validation of={props.of} />
      {solver && <Noise of={solver} />}
      {solver && <Fits of={solver} />}
      <h3>Parameters</h3>
      <DataTable
        caption={'Parameters of version ' + props.of.version}
        head={['Parameter', 'Value', 'Sigma']}
        rows={props.of.estimates.map((e) => {
          const { value, sigma, unit } = shown(e);
          return [
            component(e.component),
            quantity(value, unit),
            sigma > 0 ? number(sigma) : 'held',
          ];
        })}
      />
    </section>
  );
}

export function Calibrations(props: { rig: string; caller: Caller | null; version: number }) {
  const url = useAddress();
  const shown = /\/calibrations\/(\d+)$/.exec(url.pathname)?.[1];
  const [asked, setAsked] = useState<Calibration | null>(null);
  const [changed, setChanged] = useState(0);
  const base = rigPath(props.rig) + '/calibrations';
  const read = useRead<ListCalibrationsResponse>(base + '?page_size=100', props.version + changed);
  const title = 'Calibrations of ' + props.rig;
  const may = mayAdminister(props.caller, 'rigs/' + props.rig);
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {({ calibrations, nextPageToken }) => {
          const active = calibrations.find((c) => c.state === 'ACTIVE')?.version ?? '';
          const one = calibrations.find((c) => c.version === shown);
          return (
            <>
              {nextPageToken && <p class="quiet">The newest 100 versions.</p>}
              <DataTable
                caption="Versions"
                head={[
                  'Version',
                  'State',
                  'Verdict',
                  'Created',
                  'Segments',
                  'Reprojection rms [px]',
                  ...(may ? ['Change'] : []),
                ]}
                rows={calibrations.map((c) => [
                  <Link to={pageOf(c.name)} current={c.version === shown}>
                    {c.version === '1' ? '1 (factory)' : c.version}
                  </Link>,
                  <Badge state={c.state} />,
                  c.verdict ? <Badge state={c.verdict.kind} /> : '',
                  <When time={c.createTime} />,
                  c.provenance?.segments.length ?? '',
                  c.solver ? number(c.solver.reprojectionRmsAfterPx) : '',
                  ...(may
                    ? [
                        ['SUPERSEDED', 'ROLLED_BACK'].includes(c.state) ? (
                          <button type="button" onClick={() => setAsked(c)}>
                            {Number(c.version) < Number(active) ? 'Roll back to it' : 'Activate'}
                          </button>
                        ) : (
                          ''
                        ),
                      ]
                    : []),
                ])}
              />
              {shown && !one && (
                <Problem
                  error={{
                    code: 'NOT_FOUND',
                    message: `Version ${shown} is not in this list.`,
                    whatToDo: 'Choose one from the table.',
                  }}
                />
              )}
              {one && <Version of={one} />}
              <h2>History</h2>
              <History of={calibrations} />
              <Difference rig={props.rig} of={calibrations} />
              {asked && (
                <Activate
                  calibration={asked}
                  active={active}
                  onEnd={() => {
                    setAsked(null);
                    setChanged((count) => count + 1);
                  }}
                />
              )}
            </>
          );
        }}
      </Loaded>
    </>
  );
}
