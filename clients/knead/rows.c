#include "clients/knead/rows.h"

void kn_rows_head(FILE *out)
{
    fputs("tick,time_s,probe,x_m,y_m,z_m,contact_fx_n,contact_fy_n,contact_fz_n,fx_n,fy_n,fz_n,tx_n_m,ty_n_m,tz_n_m,"
          "contacts,residual,execution_ns,proxy_x_m,proxy_y_m,proxy_z_m\n",
          out);
}

void kn_rows_add(FILE *out, const kn_row_of_force *r)
{
    const double *vectors[] = {r->position_m, r->contact_force_n, r->force_n, r->torque_n_m};
    fprintf(out, "%lld,%.3f,%s", (long long)r->tick, r->time_s, r->probe);
    for (int i = 0; i < 4; i++) fprintf(out, ",%.9g,%.9g,%.9g", vectors[i][0], vectors[i][1], vectors[i][2]);
    const double *proxy = r->proxy_position_m;
    fprintf(out, ",%d,%.3g,%lld,%.9g,%.9g,%.9g\n", r->contacts, r->residual, (long long)r->execution_ns, proxy[0],
            proxy[1], proxy[2]);
}

void kn_rows_tick(FILE *out, const kn_replay *r, int p)
{
    const kn_replay_tick *t = &r->tick;
    const kn_force *f = &t->out.force[p];
    kn_rows_add(out, &(kn_row_of_force){t->out.tick, t->execution_ns, t->time_s, r->model->def.probe[p].name,
                                        t->pose[p].position_m, f->contact_force_n, f->force_n, f->torque_n_m,
                                        f->proxy_position_m, f->contacts, f->residual});
}
