import { idOf, pageOf, type Segment } from '../api';
import { bytes, number } from '../format';
import { Badge, DataTable, Empty, Link, Loaded, Pager, Title, When } from '../parts';
import { useAddress, useRead, withQuery } from '../state';

function kept(segment: Segment): string {
  const tables = segment.scores.filter((s) => s.inTable).map((s) => s.group);
  return tables.length > 0 ? tables.join(', ') : 'none';
}

export function Segments(props: { rig: string; version: number }) {
  const token = useAddress().searchParams.get('page_token') ?? '';
  const read = useRead<{ segments: Segment[]; nextPageToken: string }>(
    `rigs/${encodeURIComponent(props.rig)}/segments?page_token=${token}`,
    props.version,
  );
  const title = 'Segments of ' + props.rig;
  return (
    <>
      <Title text={title}>{title}</Title>
      <Loaded read={read}>
        {(listed) =>
          listed.segments.length === 0 ? (
            <Empty>
              No segment has arrived yet. Send some with the client library, or{' '}
              <code>selfcal import {props.rig} DIR</code>.
            </Empty>
          ) : (
            <>
              <DataTable
                caption={title}
                hideCaption
                head={['Segment', 'Received', 'State', 'In tables', 'Gain [nats]', 'Reprojection rms [px]', 'Data']}
                rows={listed.segments.map((segment) => [
                  <Link to={pageOf(segment.name)}>
                    {decodeURIComponent(idOf(segment.name))}
                  </Link>,
                  <When time={segment.receiveTime} />,
                  <Badge state={segment.state} />,
                  kept(segment),
                  segment.scores
                    .map((s) => `${s.group} ${number(s.gainNats)}`)
                    .join(', '),
                  segment.residuals ? number(segment.residuals.reprojectionRmsPx) : '',
                  segment.hasData ? bytes(segment.payloadBytes) : 'dropped',
                ])}
              />
              <Pager
                next="Older segments"
                first={token ? withQuery({ page_token: '' }) : null}
                more={
                  listed.nextPageToken
                    ? withQuery({ page_token: listed.nextPageToken })
                    : null
                }
              />
            </>
          )
        }
      </Loaded>
    </>
  );
}
