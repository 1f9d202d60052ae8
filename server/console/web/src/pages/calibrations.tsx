import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { ActionDialog, mayAdminister } from '../action';
import { idOf, pageOf, post, rigOf, rigPath } from '../api';
import { Comparison } from '../comparison';
import type {
  Calibration,
  Caller,
  ComponentEstimate,
  Instruction,
  ListCalibrationsResponse,
  NoiseFactor,
  SegmentFit,
  SolverReport,
  Validation_Check,
} from '../contract';
import { component, heading, number, shown, sigmaText, valueText, words } from '../format';
import { History } from '../history';
import { Given, instruct, isReported, useActivity } from '../instruction';
import {
  Badge,
  Figures,
  Link,
  Loaded,
  Problem,
  SegmentLink,
  SegmentLinks,
  solverFigures,
  Title,
  VerdictBox,
  When,
} from '../parts';
import { useAddress, useRead } from '../state';
import { DataTable, type Column } from '../table';

// The device of the rig is instructed if one reports it.
function Activate(props: {
  calibration: Calibration;
  active: string;
  isReported: boolean;
  onGiven: (instruction: Instruction) => void;
  onEnd: () => void;
}) {
  const { calibration, isReported } = props;
  const { name } = calibration;
  const back = Number(calibration.version) < Number(props.active);
  return (
    <ActionDialog
      title={`${back ? 'Roll back to' : 'Activate'} version ${calibration.version}?`}
      button={back ? 'Roll back' : 'Activate'}
      act={async (reason) => {
        if (!isReported) await post(name + ':activate', { reason });
        else props.onGiven(await instruct(rigOf(name), { activateCalibration: { name, reason } }));
      }}
      onEnd={props.onEnd}
    >
      {isReported ? (
        <p>
          A device reports this rig: it gets an instruction, and uses the version in place of
          version {props.active} with its next report. Its event log records the reason.
        </p>
      ) : (
        <p>
          Every device that watches this rig receives it at once, and uses it in place of version{' '}
          {props.active}. The event log records the reason.
        </p>
      )}
    </ActionDialog>
  );
}

const kOutcomes: Record<string, string> = {
  PASSED: 'passed',
  FAILED: 'failed',
  NOT_TESTED: 'not tested',
};

function outcomeOf(check: Validation_Check): string {
  return kOutcomes[check.outcome] ?? (check.passed ? 'passed' : 'failed');
}

const kChecks: Column<Validation_Check>[] = [
  { head: 'Check', cell: (check) => words(check.name), value: (check) => words(check.name) },
  {
    head: 'Outcome',
    cell: (check) => {
      const outcome = outcomeOf(check);
      return outcome === 'failed' ? <strong>{outcome}</strong> : outcome;
    },
    value: outcomeOf,
  },
  {
    head: 'Value',
    cell: (check) => (outcomeOf(check) === 'not tested' ? '' : number(check.value)),
  },
  {
    head: 'Limit',
    cell: (check) => (outcomeOf(check) === 'not tested' ? '' : number(check.limit)),
  },
  { head: 'Meaning', cell: (check) => check.sentence, wide: true },
];

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
      <DataTable caption="Checks" columns={kChecks} items={validation.checks} />
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

const kNoise: Column<NoiseFactor>[] = [
  { head: 'Kind of noise', cell: (factor) => words(factor.kind) },
  {
    head: 'Estimated from the residuals',
    cell: (factor) =>
      factor.determined
        ? `${number(factor.factor)} ± ${number(100 * factor.logSigma, 2)} %`
        : 'not determined',
  },
  {
    head: 'Used',
    cell: (factor) =>
      factor.used === 0 ? '' : number(factor.used) + (factor.converged ? '' : ' (not converged)'),
  },
];

function Noise(props: { of: SolverReport }) {
  if (props.of.noiseFactors.length === 0) return null;
  return (
    <>
      <h3>Noise scales</h3>
      <p class="quiet">The actual noise, relative to the noise that the rig states.</p>
      <DataTable caption="Noise scales" columns={kNoise} items={props.of.noiseFactors} />
    </>
  );
}

const kFits: Column<SegmentFit>[] = [
  {
    head: 'Segment',
    cell: (fit) => <SegmentLink name={fit.segment} />,
    value: (fit) => fit.segment,
  },
  {
    head: 'Pixel residuals',
    cell: (fit) => (fit.pixelRatio > 0 ? number(fit.pixelRatio) : ''),
    value: (fit) => fit.pixelRatio || undefined,
  },
  {
    head: 'IMU residuals',
    cell: (fit) => (fit.inertialRatio > 0 ? number(fit.inertialRatio) : ''),
    value: (fit) => fit.inertialRatio || undefined,
  },
  { head: 'Reason of an exclusion', cell: (fit) => fit.excluded, wide: true },
];

// The fit of each segment, where it was measured.
function Fits(props: { of: SolverReport }) {
  if (props.of.segmentFits.length === 0) return null;
  return (
    <>
      <h3>Fit of each segment</h3>
      <p class="quiet">Residuals relative to what the noise predicts; 1 is as expected.</p>
      <DataTable caption="Fit of each segment" columns={kFits} items={props.of.segmentFits} />
    </>
  );
}

const kParameters: Column<ComponentEstimate>[] = [
  {
    head: 'Parameter',
    cell: (e) => heading(component(e.component), shown(e).unit),
    value: (e) => component(e.component),
  },
  {
    head: 'Value',
    cell: (e) => valueText(shown(e).value, shown(e).sigma),
  },
  {
    head: 'Standard deviation',
    cell: (e) => (e.sigma > 0 ? sigmaText(shown(e).sigma) : 'held constant'),
  },
];

function Version(props: { of: Calibration }) {
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => heading.current?.scrollIntoView(), [props.of.version]);
  const solver = props.of.solver;
  return (
    <section>
      <h2 ref={heading}>
        Version {props.of.version} <Badge state={props.of.state} />
      </h2>
      <VerdictBox of={props.of} />
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
        columns={kParameters}
        items={props.of.estimates}
      />
    </section>
  );
}

// Names the version; that which is shown is marked.
export function versionColumn(shown: string | undefined): Column<Calibration> {
  return {
    head: 'Version',
    cell: (c) => (
      <Link to={pageOf(c.name)} current={c.version === shown}>
        {c.version === '1' ? '1 (factory)' : c.version}
      </Link>
    ),
    value: (c) => Number(c.version),
  };
}

export const kVersionDetails: Column<Calibration>[] = [
  { head: 'State', cell: (c) => <Badge state={c.state} />, value: (c) => words(c.state) },
  {
    head: 'Verdict',
    cell: (c) => (c.verdict ? <Badge state={c.verdict.kind} /> : ''),
    value: (c) => c.verdict?.text ?? '',
  },
  {
    head: 'Created',
    cell: (c) => <When time={c.createTime} />,
    value: (c) => Date.parse(c.createTime ?? ''),
    order: 'create_time',
  },
  {
    head: 'Segments',
    cell: (c) => c.provenance?.segments.length ?? '',
    value: (c) => c.provenance?.segments.length,
  },
  {
    head: 'Reprojection error [px]',
    cell: (c) => (c.solver ? number(c.solver.reprojectionRmsAfterPx) : ''),
    value: (c) => c.solver?.reprojectionRmsAfterPx,
  },
];

function versionColumns(
  shown: string | undefined,
  active: string,
  onActivate: ((asked: Calibration) => void) | null,
): Column<Calibration>[] {
  const columns = [versionColumn(shown), ...kVersionDetails];
  if (!onActivate) return columns;
  const button = (c: Calibration) => (
    <button type="button" onClick={() => onActivate(c)}>
      {Number(c.version) < Number(active) ? 'Roll back to it' : 'Activate'}
    </button>
  );
  return [
    ...columns,
    {
      head: 'Activation',
      cell: (c) => (['SUPERSEDED', 'ROLLED_BACK'].includes(c.state) ? button(c) : ''),
    },
  ];
}

function Versions(props: {
  of: Calibration[];
  shown: string | undefined;
  onActivate: ((asked: Calibration) => void) | null;
  active: string;
}) {
  const { of, shown, active, onActivate } = props;
  const may = onActivate !== null;
  const columns = useMemo(
    () => versionColumns(shown, active, onActivate),
    // Callers pass new but equal functions.
    // eslint-disable-next-line react-hooks/exhaustive-deps
    [shown, active, may],
  );
  return <DataTable caption="Versions" columns={columns} items={of} />;
}

export function Calibrations(props: { rig: string; caller: Caller | null; version: number }) {
  const url = useAddress();
  const shown = /\/calibrations\/(\d+)$/.exec(url.pathname)?.[1];
  const [asked, setAsked] = useState<Calibration | null>(null);
  const [given, setGiven] = useState<Instruction | null>(null);
  const [changed, setChanged] = useState(0);
  const base = rigPath(props.rig) + '/calibrations';
  const read = useRead<ListCalibrationsResponse>(base + '?page_size=100', props.version + changed);
  const activity = useActivity(props.rig, props.version);
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
              {given && <Given of={given} />}
              {nextPageToken && <p class="quiet">The newest {calibrations.length} versions.</p>}
              <Versions
                of={calibrations}
                shown={shown}
                active={active}
                onActivate={may ? setAsked : null}
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
              <History of={calibrations} />
              <Comparison rig={props.rig} of={calibrations} />
              {asked && (
                <Loaded read={activity}>
                  {(found) => (
                    <Activate
                      calibration={asked}
                      active={active}
                      isReported={isReported(found)}
                      onGiven={setGiven}
                      onEnd={() => {
                        setAsked(null);
                        setChanged((count) => count + 1);
                      }}
                    />
                  )}
                </Loaded>
              )}
            </>
          );
        }}
      </Loaded>
    </>
  );
}
